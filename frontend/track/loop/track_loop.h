#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "frontend/core/options.h"
#include "frontend/detect/corners.h"
#include "frontend/image/exposure.h"
#include "frontend/image/frame.h"
#include "frontend/track/loop/feature_mover.h"
#include "frontend/track/loop/scene_watch.h"
#include "frontend/tracks/observation.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

struct TrackLoopOptions {
  int max_unconfirmed_frames = 20;
  bool cuts = true;
  DetectorOptions detector;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("max_unconfirmed_frames",
             o.max_unconfirmed_frames,
             0,
             100000,
             "a feature ends after more than this many frames in a row in which the image does not "
             "confirm it");
    v.Flag("cuts",
           o.cuts,
           "End all tracks at cuts of the clip, and keep them through frames that show nothing. "
           "Otherwise features that look alike by chance on both sides of a cut are tracked across "
           "it.",
           Tier::kCommon);
    v.Group("detector", o.detector, "corner detection");
  }
};

// The tracks of one frame.
struct FrameResult {
  std::vector<Observation> observations;  // ascending features; of this frame
  std::vector<TrackEnd> ends;             // tracks that ended before this frame, ascending features
  bool cut = false;        // this frame is the first of another scene: all tracks ended before it
  double detect_ms = 0.0;  // time spent on finding corners; for reports
  // A tracker is causal: it never corrects states or positions of earlier frames.
};

// A tracker: the bookkeeping that all share, so that an experiment changes one thing at a time,
// around the mover, in which they differ. It has one light for all frames (Exposure), detection,
// re-detection when features die, ids, borders, mask, the limit of unconfirmed frames, and the end
// of all features at a cut. Synchronous and causal, without threads or queues.
class TrackLoop {
 public:
  TrackLoop(const TrackLoopOptions& options, std::unique_ptr<FeatureMover> mover);

  // Features are neither born nor stay where the frame's mask is 0.
  FrameResult Track(const Frame& frame);

 private:
  struct LiveFeature {
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

  TrackLoopOptions options_;
  cv::Mat mask_;  // of the current frame
  std::unique_ptr<FeatureMover> mover_;
  Exposure exposure_;
  SceneWatch watch_;
  std::vector<LiveFeature> features_;
  std::uint32_t next_id_ = 0;
  std::optional<FrameIndex> previous_frame_;
  cv::Size size_;
};

}  // namespace cohort
