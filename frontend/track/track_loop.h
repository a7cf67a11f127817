#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "frontend/image/pyramid.h"
#include "frontend/track/tracker.h"

namespace cohort {

// Where a feature went, as a mover says.
struct Move {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  ObservationState state = ObservationState::kObserved;
  double residual = 0.0;  // mean absolute difference to the template, intensities 0..1
  std::optional<PixelCovariance> covariance;
  std::optional<LossReason> loss;  // set: the feature ends, xy is not used
};

// What differs between trackers: how the live features move from one frame to the next. The
// features are numbered 0 .. F - 1 in the order of their birth; a mover keeps its own data
// (templates, history) in the same order.
class FeatureMover {
 public:
  virtual ~FeatureMover() = default;
  // Called once a frame, with the current picture. Returns one Move for every feature.
  virtual std::vector<Move> MoveFeatures(const Pyramid& current) = 0;
  // After the loop has decided who lives: keep[f] == 0 ends feature f.
  virtual void Keep(std::span<const std::uint8_t> keep) = 0;
  // New features at these positions of the current picture, behind the old ones.
  virtual void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) = 0;
};

// The mover of `options.tracker`. For those who keep the books themselves; trackers are made by
// MakeTracker.
std::unique_ptr<FeatureMover> MakeMover(const TrackerOptions& options);

// The bookkeeping that all trackers share, so that an experiment changes one thing at a time:
// detection, re-detection when features die, ids, borders, mask, and how long a feature may go
// unconfirmed.
class TrackLoop final : public Tracker {
 public:
  // `mask`: empty, or CV_8UC1 of the frames' size, 0 where features may neither be born nor stay.
  TrackLoop(const TrackerOptions& options, cv::Mat mask, std::unique_ptr<FeatureMover> mover);

  FrameResult Track(const Frame& frame) override;

 private:
  struct Feature {
    FeatureId id{};
    Eigen::Vector2d xy;
    int unconfirmed_frames = 0;
  };

  std::optional<LossReason> ReasonToEnd(const Move& move, int unconfirmed_frames) const;

  TrackerOptions options_;
  cv::Mat mask_;
  std::unique_ptr<FeatureMover> mover_;
  std::vector<Feature> features_;
  std::uint32_t next_id_ = 0;
  std::optional<FrameIndex> previous_frame_;
  cv::Size size_;
};

}  // namespace cohort
