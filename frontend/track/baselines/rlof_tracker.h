#pragma once

#include <memory>

#include "frontend/core/options.h"
#include "frontend/track/loop/feature_mover.h"

namespace cohort {

// Baseline: robust local optical flow of OpenCV.
struct RlofOptions {
  int window_px = 31;
  int max_level = 4;
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

// Baseline: robust local optical flow (cv::optflow::calcOpticalFlowSparseRLOF; Senst, Eiselein,
// Sikora 2012-2016), that is, Lucas-Kanade with a redescending norm, started from the whole
// picture's motion. It has the same forward-backward check as klt.
std::unique_ptr<FeatureMover> MakeRlofMover(const RlofOptions& options);

}  // namespace cohort
