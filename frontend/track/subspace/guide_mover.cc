#include "frontend/track/subspace/guide_mover.h"

#include "frontend/energy/patch_energy.h"
#include "frontend/track/subspace/joint_guide.h"

namespace cohort {
namespace {

class GuideMover final : public FeatureMover {
 public:
  explicit GuideMover(const SubspaceOptions& options) : options_(options) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) override {
    const std::vector<std::uint8_t> confirmed(guide_.templates().size(), 1);
    const Eigen::Matrix2Xd x = guide_.Find(current, confirmed);
    std::vector<Move> moves(confirmed.size());
    for (std::size_t f = 0; f < moves.size(); ++f) {
      const auto& patch = guide_.templates()[f].front();
      moves[f].xy = x.col(static_cast<Eigen::Index>(f));
      moves[f].residual = PatchEnergy(current.levels[0], moves[f].xy, patch, options_.template_px);
      if (!moves[f].xy.allFinite()) moves[f].loss = LossReason::kDiverged;
    }
    guide_.Remember(current, x, confirmed);
    return moves;
  }

  void Keep(std::span<const std::uint8_t> keep) override { guide_.Keep(keep); }

  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override {
    if (guide_.templates().empty()) guide_.Begin(current);
    guide_.Add(born, current);
  }

 private:
  SubspaceOptions options_;
  JointGuide guide_{options_};
};

}  // namespace

std::unique_ptr<FeatureMover> MakeGuideMover(const SubspaceOptions& options) {
  return std::make_unique<GuideMover>(options);
}

}  // namespace cohort
