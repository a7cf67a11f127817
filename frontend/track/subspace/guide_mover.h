#pragma once

#include <memory>

#include "frontend/track/loop/feature_mover.h"
#include "frontend/track/measure/measurement.h"
#include "frontend/track/subspace/joint_guide.h"

namespace cohort {

// The joint guide alone, without measuring, as in the paper: every feature is observed at the
// minimum of the total energy. With penalty_weight 0 each feature moves independently (the paper's
// "1st-order descent"). `patch` fills the history of new features.
std::unique_ptr<FeatureMover> MakeGuideMover(const SubspaceOptions& options,
                                             const PatchOptions& patch);

}  // namespace cohort
