#include "frontend/track/subspace/guide.h"

#include "frontend/track/subspace/joint_guide.h"
#include "frontend/track/subspace/lucas_kanade_guide.h"

namespace cohort {

std::unique_ptr<Guide> MakeGuide(const SubspaceOptions& options) {
  if (options.penalty == PenaltyKind::kNone) return std::make_unique<LucasKanadeGuide>();
  return std::make_unique<JointGuide>(options);
}

}  // namespace cohort
