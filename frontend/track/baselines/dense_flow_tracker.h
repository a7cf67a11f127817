#pragma once

#include <memory>

#include "frontend/core/options.h"
#include "frontend/track/loop/feature_mover.h"

namespace cohort {

// Baselines: tracks chained from dense flow.
struct DenseFlowOptions {
  double forward_backward_px = 0.7071;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.0,
             100.0,
             "a feature ends if the flow back misses its start by more [px]; 0: no check");
  }
};

// Baselines that stand in for the paper's LDOF. They chain tracks from dense flow, sample it
// bilinearly at the features' sub-pixel positions and check it by the backward flow (Sundaram,
// Brox, Keutzer 2010). `dis` is cv::DISOpticalFlow, preset medium; `deepflow` is cv::optflow's
// DeepFlow, which takes about a second for one flow at 640 x 480.
enum class DenseFlowMethod { kDis, kDeepFlow };
std::unique_ptr<FeatureMover> MakeDenseFlowMover(DenseFlowMethod method,
                                                 const DenseFlowOptions& options);

}  // namespace cohort
