#pragma once

#include <memory>

#include "frontend/track/track_loop.h"

namespace cohort {

// Baselines, stand-ins for the paper's LDOF: tracks chained from dense flow, which is sampled
// bilinearly at the features' sub-pixel positions and checked by the flow back (Sundaram, Brox,
// Keutzer 2010). `dis`: cv::DISOpticalFlow, preset medium; `deepflow`: cv::optflow's DeepFlow, a
// second or so a flow at 640 x 480. `tracker` is one of these two.
std::unique_ptr<FeatureMover> MakeDenseFlowMover(TrackerKind tracker,
                                                 const DenseFlowOptions& options);

}  // namespace cohort
