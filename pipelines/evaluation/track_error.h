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

// Where a point of a surface truly is in a frame.
struct TrueSighting {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  bool visible = false;  // in the image, and nothing stands before it
};

// The path of one point of a surface: its sighting in a frame, none where there is no truth of this
// frame, which then counts in no figure.
using TruePath = std::function<std::optional<TrueSighting>(FrameIndex)>;

// The path of the surface point that is seen at `xy` in a frame; none where no surface is known.
using TrackTruthOracle = std::function<std::optional<TruePath>(FrameIndex, const Eigen::Vector2d&)>;

// `frames` are the clip's, ascending: also those in which no track is left.
//
// The error of a track is its drift: the distance to where the surface point at its own first
// observed position is now. A track has no other claim: what it was born on is what it follows. The
// first position itself has no error and is not counted.

struct ErrorSummary {
  std::size_t count = 0;
  double median_px = 0.0;
  double p90_px = 0.0;  // linear between the two nearest, as numpy's percentile
  double mean_px = 0.0;
};

// How often features leave the truth (the paper's section 4, first mode): a track needs to be
// initialised anew when it is more than `limit_px` off, or when it ends though its point is still
// visible in the next frame, not closer to the image's border than a tracker's patch needs. Its
// later frames do not count. Frames in which the point is hidden are neither counted nor judged.
struct ReinitializationFigure {
  std::size_t frames = 0;  // feature-frames within the limit
  std::size_t reinitializations = 0;
  std::optional<double> mean_frames_between;  // none: never
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
// whose points stay visible for `count` more frames: the sum over those frames of |dx| + |dy|
// [px], mean over tracks. A track that ends early stays where it was, so that giving up wins
// nothing.
struct TrajectoryL1Figure {
  std::size_t tracks = 0;
  double mean_px = 0.0;
};
// None without such tracks, or if the clip has fewer frames.
std::optional<TrajectoryL1Figure> MeasureTrajectoryL1(const TrackSet& tracks,
                                                      std::span<const FrameIndex> frames,
                                                      const TrackTruthOracle& truth,
                                                      std::size_t count = 30);

// Whether the tracker's covariances are right. An error d = observed - true position, less the
// median of its track's (all have the error of where the track began: that says which point it
// follows, not how well), with the covariance S = L L^T is normalised to L^-1 d: two numbers that,
// if S is right, are standard normal, and whose squares' sum has the median 2 log 2 = 1.386.
struct CalibrationFigure {
  static constexpr double kHistogramSigmas = 5.0;    // bins of equal width from -5 to 5 ...
  static constexpr std::size_t kHistogramBins = 41;  // ... the middle one about 0
  std::size_t count = 0;                             // observations; the numbers are twice as many
  double nees_ratio = 0.0;                           // median of |L^-1 d|^2, over 1.386
  double robust_sigma = 0.0;                         // 1.4826 median |L^-1 d|_i
  double share_beyond_3 = 0.0;                       // of the numbers; 0.0027 if S is right
  std::array<std::size_t, kHistogramBins> histogram{};  // beyond the ends: not counted
  // The same of each tenth of the observations, from those that claim to be most certain to those
  // that claim least: does a large covariance mean a large error? Of fewer than 1000: none.
  struct Tenth {
    double claimed_px = 0.0;  // median of sqrt(trace(S) / 2)
    double nees_ratio = 0.0;
  };
  std::vector<Tenth> tenths;
};

// What `evaluate` says of tracks.
struct TrackEvaluation {
  std::size_t tracks = 0;
  std::size_t tracks_without_truth = 0;          // left out of all figures
  std::optional<ErrorSummary> observed;          // none: no observed position beyond the first
  std::optional<double> outlier_share;           // of the observed: more than 3 px off
  std::optional<CalibrationFigure> calibration;  // none: no observation has a covariance
  // Predicted positions by for how many frames, this one included, the point has been hidden: 0
  // (it is visible, and the tracker did not see it), 1, 5, 10, 20, 50.
  std::map<int, ErrorSummary> predicted;
  // The same of all positions of hidden points, whatever state they have; and of those which are
  // called observed, hidden for any number of frames.
  std::map<int, ErrorSummary> hidden;
  std::optional<ErrorSummary> hidden_but_observed;
  // The state `predicted` as a statement that the point is hidden.
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
