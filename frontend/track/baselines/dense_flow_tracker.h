#pragma once

#include <memory>

#include "frontend/core/options.h"
#include "frontend/track/loop/feature_mover.h"

namespace cohort {

// Baseline: tracks chained from dense flow.
struct DenseFlowOptions {
  double forward_backward_px = 0.7071;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.0,
             100.0,
             "forward-backward check: a feature ends if the flow back misses its start by more "
             "than this [px]; 0: no check");
  }
};

// Baseline that stands in for the paper's LDOF. It chains tracks from dense flow
// (cv::DISOpticalFlow, preset medium), samples it bilinearly at the features' sub-pixel positions
// and checks it by the backward flow (Sundaram, Brox, Keutzer 2010).
std::unique_ptr<FeatureMover> MakeDenseFlowMover(const DenseFlowOptions& options);

}  // namespace cohort
