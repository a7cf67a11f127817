#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "backend/scene/frame_times.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// Tracks in the mapper's form: frames, tracks and observations numbered from 0.
struct WhitenedObservation {
  int frame = 0;
  int track = 0;
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();                  // pixels
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();  // what bundle adjustment takes
  Eigen::Matrix2d whitening = Eigen::Matrix2d::Identity();       // W^T W = covariance^-1
};

struct WhiteningOptions {
  int min_track_length = 3;
  bool use_covariances = true;
  double covariance_floor_px = 0.1;  // added in quadrature to a measured covariance
};

class WhitenedTracks {
 public:
  // Observed positions of tracks with at least min_track_length of them.
  WhitenedTracks(const TrackFile& file, const WhiteningOptions& options);

  // The same observations at other positions, in the order of observations().
  WhitenedTracks WithPositions(const std::vector<Eigen::Vector2d>& xy) const;

  // Only these tracks, in their order.
  WhitenedTracks Select(const std::vector<int>& tracks) const;

  int frame_count() const { return static_cast<int>(frames_.size()); }
  int track_count() const { return static_cast<int>(features_.size()); }
  const std::vector<FrameInfo>& frames() const { return frames_; }
  const FrameTimes& frame_times() const { return frame_times_; }
  const std::vector<FeatureId>& features() const { return features_; }
  const std::vector<WhitenedObservation>& observations() const { return observations_; }

  // Indices into observations(): those of a track are [first, last), ascending frames.
  std::pair<int, int> TrackRange(int track) const {
    return {first_of_track_[track], first_of_track_[track + 1]};
  }
  // The range of those in frames from `first` to `last`.
  std::pair<int, int> RangeWithin(int track, int first, int last) const;
  // ascending tracks
  const std::vector<int>& ObservationsIn(int frame) const { return in_frame_[frame]; }
  std::optional<int> FindObservation(int track, int frame) const;

  // The observations that two frames share, as pairs of indices; ascending tracks.
  std::vector<std::pair<int, int>> CommonObservations(int frame_a, int frame_b) const;

  // Whether neighbouring frames share less than half of the usual number of tracks. Across such a
  // seam all tracks may be needed to hold the model's scale.
  bool HasSeam() const;

 private:
  WhitenedTracks() = default;

  std::vector<FrameInfo> frames_;
  FrameTimes frame_times_;
  std::vector<FeatureId> features_;
  std::vector<WhitenedObservation> observations_;
  std::vector<int> first_of_track_;
  std::vector<std::vector<int>> in_frame_;
};

}  // namespace cohort
