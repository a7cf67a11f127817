#pragma once

#include <memory>

#include "frontend/core/options.h"
#include "frontend/track/feature_mover.h"

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
             "a feature ends if tracking back misses its start by more [px]; 0: no check");
  }
};

// Baseline: the same from frame to frame as a guide, then once more against the feature's first
// frame.
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
             "pyramid levels above full resolution, from frame to frame");
    v.Number("anchor_max_level",
             o.anchor_max_level,
             0,
             8,
             "pyramid levels above full resolution, against the first frame");
    v.Number("max_distance_px",
             o.max_distance_px,
             0.1,
             50.0,
             "a place further from the guide is unconfirmed [px]");
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.01,
             100.0,
             "unconfirmed if tracking back misses the place in the first frame by more [px]");
    v.Number("max_unconfirmed_frames",
             o.max_unconfirmed_frames,
             0,
             100000,
             "a feature unconfirmed for more frames in a row ends");
  }
};

// The baseline: pyramidal Lucas-Kanade from frame to frame (cv::calcOpticalFlowPyrLK), each feature
// for itself, checked by tracking back: a feature that does not return to within
// forward_backward_px of where it came from ends.
std::unique_ptr<FeatureMover> MakeKltMover(const KltOptions& options);

// The same as a guide, and then Lucas-Kanade once more from the guided position against the
// feature's own first frame, so that errors do not add up: a translation, on few levels. The result
// is observed where it is near the guide and tracks back to where the feature began, else the
// feature stays predicted at the guide; it ends after some such frames in a row. It has what
// anchoring is worth by itself, without any constraint between features.
std::unique_ptr<FeatureMover> MakeAnchoredKltMover(const AnchoredKltOptions& options);

}  // namespace cohort
