#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "frontend/image/exposure.h"
#include "frontend/track/loop/feature_mover.h"
#include "frontend/track/loop/scene_watch.h"
#include "frontend/track/tracker.h"

namespace cohort {

// The mover of `options.tracker`, for callers that do the bookkeeping themselves; MakeTracker makes
// complete trackers.
std::unique_ptr<FeatureMover> MakeMover(const TrackerOptions& options);

// The bookkeeping that all trackers share, so that an experiment changes one thing at a time:
// one light for all frames (Exposure), detection, re-detection when features die, ids, borders,
// mask, the limit of unconfirmed frames, and the end of all features at a cut.
class TrackLoop final : public Tracker {
 public:
  TrackLoop(const TrackerOptions& options, std::unique_ptr<FeatureMover> mover);

  FrameResult Track(const Frame& frame) override;

 private:
  struct Feature {
    FeatureId id{};
    Eigen::Vector2d xy;
    int unconfirmed_frames = 0;
  };

  void CheckSize(const cv::Size& size);
  // These add to the tracker's result of the frame.
  void EndAtCut(FrameResult& result);
  void HoldFeatures(FrameIndex frame, FrameResult& result);
  void MoveFeatures(const Pyramid& pyramid, FrameIndex frame, FrameResult& result);
  void DetectFeatures(const Pyramid& pyramid, FrameIndex frame, int max_new, FrameResult& result);
  void UseMoves(std::span<const Move> moves, FrameIndex frame, FrameResult& result);
  std::optional<LossReason> ReasonToEnd(const Move& move, int unconfirmed_frames) const;

  TrackerOptions options_;
  cv::Mat mask_;  // of the current frame
  std::unique_ptr<FeatureMover> mover_;
  Exposure exposure_;
  SceneWatch watch_;
  std::vector<Feature> features_;
  std::uint32_t next_id_ = 0;
  std::optional<FrameIndex> previous_frame_;
  cv::Size size_;
};

}  // namespace cohort
