#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "frontend/tracks/track_set.h"

namespace cohort {

// The true position of a surface point in a frame.
struct TrueSighting {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  bool visible = false;  // in the image and not hidden
};

// The path of one surface point: its sighting in a frame, nullopt if the frame has no ground truth;
// it then counts in no figure.
using TruePath = std::function<std::optional<TrueSighting>(FrameIndex)>;

// The path of the surface point at `xy` in a frame; nullopt if no surface is known.
using TrackTruthOracle = std::function<std::optional<TruePath>(FrameIndex, const Eigen::Vector2d&)>;

// `frames` are the clip's, ascending, including those without tracks.
//
// The error of a track is its drift: the distance to the current position of the surface point at
// its own first observed position. A track makes no other claim: it follows the point on which it
// was born. The first position itself has no error and is not counted.

struct ErrorSummary {
  std::size_t count = 0;
  double median_px = 0.0;
  double p90_px = 0.0;  // linear between the two nearest, as numpy's percentile
  double mean_px = 0.0;
};

// How often features leave the ground truth (the paper's section 4, first mode). A track needs
// re-initialisation when it is more than `limit_px` off, or when it ends although its point is
// still visible in the next frame and not closer to the image's border than a tracker's patch
// needs. Its later frames do not count, nor do frames in which the point is hidden.
struct ReinitializationFigure {
  std::size_t frames = 0;  // feature-frames within the limit
  std::size_t reinitializations = 0;
  std::optional<double> mean_frames_between;  // unset: no re-initialisation
};
struct ReinitializationOptions {
  double limit_px = 10.0;
  double border_px = 16.0;
  int width_px = 0;  // of the image
  int height_px = 0;
};
ReinitializationFigure MeasureReinitializations(const TrackSet& tracks,
                                                std::span<const FrameIndex> frames,
                                                const TrackTruthOracle& truth,
                                                const ReinitializationOptions& options);

// Mean L1 trajectory error (the paper's section 4, second mode) over the tracks of the first frame
// whose points stay visible for `count` more frames: the sum over those frames of |dx| + |dy| [px],
// mean over tracks. A track that ends early keeps its last position, so that giving up has no
// advantage.
struct TrajectoryL1Figure {
  std::size_t tracks = 0;
  double mean_px = 0.0;
};
// Returns nullopt without such tracks, or if the clip has fewer frames.
std::optional<TrajectoryL1Figure> MeasureTrajectoryL1(const TrackSet& tracks,
                                                      std::span<const FrameIndex> frames,
                                                      const TrackTruthOracle& truth,
                                                      std::size_t count = 30);

// Whether the tracker's covariances are right. An error d = observed - true position, minus its
// track's median (all share the error of the track's start, which determines the point that it
// follows, not the accuracy), with the covariance S = L L^T is normalised to L^-1 d. If S is right,
// its two numbers are standard normal, and the sum of their squares has the median 2 log 2 = 1.386.
struct CalibrationFigure {
  static constexpr double kHistogramSigmas = 5.0;    // bins of equal width from -5 to 5 ...
  static constexpr std::size_t kHistogramBins = 41;  // ... the middle one about 0
  std::size_t count = 0;                             // observations; the numbers are twice as many
  double nees_ratio = 0.0;                           // median of |L^-1 d|^2, divided by 1.386
  double robust_sigma = 0.0;                         // 1.4826 median |L^-1 d|_i
  double share_beyond_3 = 0.0;                       // of the numbers; 0.0027 if S is right
  std::array<std::size_t, kHistogramBins> histogram{};  // beyond the ends: not counted
  // The same for each tenth of the observations, from the smallest to the largest claimed
  // covariance, to show whether a large covariance means a large error. Empty for fewer than 1000.
  struct Tenth {
    double claimed_px = 0.0;  // median of sqrt(trace(S) / 2)
    double nees_ratio = 0.0;
  };
  std::vector<Tenth> tenths;
};

// The figures of `evaluate` for tracks.
struct TrackEvaluation {
  std::size_t tracks = 0;
  std::size_t tracks_without_truth = 0;          // left out of all figures
  std::optional<ErrorSummary> observed;          // unset: no observed position beyond the first
  std::optional<double> outlier_share;           // of the observed: more than 3 px off
  std::optional<CalibrationFigure> calibration;  // unset: no observation has a covariance
  // Errors of predicted positions by the number of frames, including this one, for which the point
  // has been hidden: 0 (it is visible, and the tracker did not see it), 1, 5, 10, 20, 50.
  std::map<int, ErrorSummary> predicted;
  // The same for all positions of hidden points in any state, and for those in state observed,
  // hidden for any number of frames.
  std::map<int, ErrorSummary> hidden;
  std::optional<ErrorSummary> hidden_but_observed;
  // The state `predicted` as a classifier of hidden points.
  std::optional<double> predicted_precision;
  std::optional<double> predicted_recall;
  ReinitializationFigure reinitializations;
  std::optional<TrajectoryL1Figure> trajectory_l1;
};
TrackEvaluation EvaluateTracks(const TrackSet& tracks,
                               std::span<const FrameIndex> frames,
                               const TrackTruthOracle& truth,
                               const ReinitializationOptions& options);

}  // namespace cohort
