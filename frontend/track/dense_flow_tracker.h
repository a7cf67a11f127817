#pragma once

#include <memory>

#include "frontend/core/options.h"
#include "frontend/track/feature_mover.h"

namespace cohort {

// Baselines: tracks chained from dense flow.
struct DenseFlowOptions {
  double denoise_sigma_px = 0.8;
  double forward_backward_px = 0.7071;
  double forward_backward_share = 0.01;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("denoise_sigma_px", o.denoise_sigma_px, 0.0, 10.0, "Gaussian blur before [px]");
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.0,
             100.0,
             "a feature ends if the flow back misses its start by more [px]; 0: no check");
    v.Number("forward_backward_share",
             o.forward_backward_share,
             0.0,
             1.0,
             "of both flows' squared lengths, which is allowed in addition");
  }
};

// Baselines, stand-ins for the paper's LDOF: tracks chained from dense flow, which is sampled
// bilinearly at the features' sub-pixel positions and checked by the flow back (Sundaram, Brox,
// Keutzer 2010). `dis`: cv::DISOpticalFlow, preset medium; `deepflow`: cv::optflow's DeepFlow, a
// second or so a flow at 640 x 480.
enum class DenseFlowMethod { kDis, kDeepFlow };
std::unique_ptr<FeatureMover> MakeDenseFlowMover(DenseFlowMethod method,
                                                 const DenseFlowOptions& options);

}  // namespace cohort
