#include "frontend/track/subspace/guide_mover.h"

#include <utility>

#include "frontend/energy/patch_energy.h"
#include "frontend/track/subspace/history_filler.h"

namespace cohort {
namespace {

class GuideMover final : public FeatureMover {
 public:
  GuideMover(const SubspaceOptions& options, const PatchOptions& patch)
      : options_(options), patch_(patch) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) override {
    const Eigen::Matrix2Xd x = guide_.Minimize(current, features_, guide_.Start(current)).x;
    std::vector<Move> moves(features_.size());
    for (std::size_t f = 0; f < moves.size(); ++f) {
      const auto& patch = features_[f].templates.front();
      moves[f].xy = x.col(static_cast<Eigen::Index>(f));
      moves[f].residual = PatchEnergy(current.levels[0], moves[f].xy, patch, options_.template_px);
      if (!moves[f].xy.allFinite()) moves[f].loss = LossReason::kDiverged;
    }
    guide_.Remember(current, x, features_);
    filler_.Remember(SmoothPyramid(current, patch_.denoise_sigma_px),
                     static_cast<std::size_t>(options_.history_length));
    return moves;
  }

  void Keep(std::span<const std::uint8_t> keep) override {
    KeepFeatures(keep, features_);
    guide_.Keep(keep);
  }

  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override {
    if (features_.empty()) {
      guide_.Begin(current);
      filler_.Begin(SmoothPyramid(current, patch_.denoise_sigma_px));
    }
    std::vector<std::vector<Eigen::Vector2d>> births;
    for (const Eigen::Vector2d& xy : born) {
      features_.push_back(TakeFeature(current, filler_.newest(), xy, options_.template_px, patch_));
      if (options_.penalty_weight > 0.0) {
        births.push_back(
            filler_.Fill(xy, features_.back().anchor, guide_.history(), calibration_).xy);
      } else {  // nobody asks where it was
        births.emplace_back(guide_.history().size(), xy);
      }
    }
    guide_.Add(births, current, features_);
  }

 private:
  SubspaceOptions options_;
  PatchOptions patch_;
  std::vector<Feature> features_;
  JointGuide guide_{options_};
  HistoryFiller filler_{patch_};
  const CovarianceCalibration calibration_;
};

}  // namespace

std::unique_ptr<FeatureMover> MakeGuideMover(const SubspaceOptions& options,
                                             const PatchOptions& patch) {
  return std::make_unique<GuideMover>(options, patch);
}

}  // namespace cohort
