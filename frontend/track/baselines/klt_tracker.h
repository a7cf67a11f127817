#pragma once

#include <memory>

#include "frontend/core/options.h"
#include "frontend/track/loop/feature_mover.h"

namespace cohort {

// Baseline: pyramidal Lucas-Kanade of OpenCV with a forward-backward check.
struct KltOptions {
  int window_px = 21;
  int max_level = 3;
  double forward_backward_px = 1.0;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Odd("window_px", o.window_px, 3, 101, "side of the tracked patch [px]");
    v.Number("max_level", o.max_level, 0, 8, "pyramid levels above full resolution");
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.0,
             100.0,
             "forward-backward check: a feature ends if tracking back misses its start by more "
             "than this [px]; 0: no check");
  }
};

// Baseline: the same from frame to frame as a guide, then a second alignment against the feature's
// first frame.
struct AnchoredKltOptions {
  int window_px = 21;
  int guide_max_level = 3;
  int anchor_max_level = 1;
  double max_distance_px = 3.0;
  double forward_backward_px = 1.0;
  int max_unconfirmed_frames = 5;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Odd("window_px", o.window_px, 3, 101, "side of the tracked patch [px]");
    v.Number("guide_max_level",
             o.guide_max_level,
             0,
             8,
             "pyramid levels above full resolution for tracking from frame to frame");
    v.Number("anchor_max_level",
             o.anchor_max_level,
             0,
             8,
             "pyramid levels above full resolution for tracking from the feature's first frame");
    v.Number("max_distance_px",
             o.max_distance_px,
             0.1,
             50.0,
             "maximum distance of a confirmed position from the guide [px]");
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.01,
             100.0,
             "forward-backward check: a position is unconfirmed if tracking back misses the "
             "position in the first frame by more than this [px]");
    v.Number("max_unconfirmed_frames",
             o.max_unconfirmed_frames,
             0,
             100000,
             "a feature ends after more than this many unconfirmed frames in a row");
  }
};

// The KLT baseline: pyramidal Lucas-Kanade from frame to frame (cv::calcOpticalFlowPyrLK), each
// feature independently. A feature ends if tracking back misses its start by more than
// forward_backward_px.
std::unique_ptr<FeatureMover> MakeKltMover(const KltOptions& options);

// The same as a guide, followed by Lucas-Kanade from the guided position against the feature's own
// first frame, so that errors do not accumulate: a translation, on few levels. The feature is
// observed if the result is near the guide and tracks back to its birth. Otherwise it stays
// predicted at the guide, and ends after several such frames in a row. This baseline isolates the
// gain of anchoring, without any constraint between features.
std::unique_ptr<FeatureMover> MakeAnchoredKltMover(const AnchoredKltOptions& options);

}  // namespace cohort
