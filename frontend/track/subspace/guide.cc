#include "frontend/track/subspace/guide.h"

#include "frontend/track/subspace/joint_guide.h"
#include "frontend/track/subspace/lucas_kanade_guide.h"

namespace cohort {

std::unique_ptr<Guide> MakeGuide(const SubspaceOptions& options) {
  if (options.penalty == PenaltyKind::kNone) return std::make_unique<LucasKanadeGuide>();
  return std::make_unique<JointGuide>(options);
}

void KeepColumns(std::span<const std::uint8_t> keep, Eigen::Matrix2Xd& x) {
  Eigen::Index kept = 0;
  for (std::size_t f = 0; f < keep.size(); ++f) {
    if (keep[f] != 0) x.col(kept++) = x.col(static_cast<Eigen::Index>(f));
  }
  x.conservativeResize(2, kept);
}

}  // namespace cohort
