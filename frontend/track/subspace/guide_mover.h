#pragma once

#include <memory>

#include "frontend/track/loop/feature_mover.h"
#include "frontend/track/subspace/subspace_options.h"

namespace cohort {

// The joint guide alone, without measuring, as in the paper: every feature is observed at the
// minimum of the total energy. Without a penalty each feature moves independently (the paper's
// "1st-order descent").
std::unique_ptr<FeatureMover> MakeGuideMover(const SubspaceOptions& options);

}  // namespace cohort
