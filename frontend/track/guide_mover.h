#pragma once

#include <memory>

#include "frontend/track/feature_mover.h"
#include "frontend/track/joint_guide.h"
#include "frontend/track/measurement.h"

namespace cohort {

// The joint guide alone, without measuring: every feature is observed where the total energy has
// its minimum, as in the paper. With penalty_weight 0, every feature for itself (its "1st-order
// descent"). `patch` fills the history of new features.
std::unique_ptr<FeatureMover> MakeGuideMover(const SubspaceOptions& options,
                                             const PatchOptions& patch);

}  // namespace cohort
