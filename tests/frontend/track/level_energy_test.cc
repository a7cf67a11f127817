#include <gtest/gtest.h>

#include "frontend/core/random_stream.h"
#include "frontend/track/subspace/joint_guide.h"
#include "tests/frontend/track/moving_picture.h"
#include "tests/support/numeric_gradient.h"

namespace cohort {
namespace {

std::vector<Templates> TemplatesAt(const Pyramid& picture) {
  std::vector<Templates> templates;
  const Eigen::Matrix2Xd x = test::GridOfTwenty();
  for (const Eigen::Vector2d xy : x.colwise()) {
    templates.push_back(TakeTemplates(picture, xy, SubspaceOptions().template_px));
  }
  return templates;
}

// Twenty features on their way: what they were and where, and a picture in which they are a little
// beside their places.
class LevelEnergyOfTwenty : public testing::TestWithParam<int> {
 protected:
  LevelEnergyOfTwenty() {
    RandomStream random(1, "test/level_energy");
    const auto disturbed = [&](const Eigen::Vector2d& shift, double px) {
      Eigen::Matrix2Xd x = test::GridOfTwenty().colwise() + shift;
      for (Eigen::Index i = 0; i < x.size(); ++i) x.data()[i] += px * random.Gaussian();
      return x;
    };
    history_.resize(2 * 4, 20);
    for (int l = 0; l < 4; ++l) {
      history_.middleRows(2 * l, 2) = disturbed({-1.3 * l, 0.8 * l}, 0.2);
    }
    x_ = disturbed({1.3, -0.8}, 0.4);
  }

  // Positions on the level that the test is of.
  Eigen::Matrix2Xd OnLevel() const { return std::ldexp(1.0, -GetParam()) * x_; }

  Pyramid picture_ = test::ShiftedNoise({1.3, -0.8});
  std::vector<Templates> templates_ = TemplatesAt(test::ShiftedNoise({0, 0}));
  Eigen::MatrixXd history_;
  Eigen::Matrix2Xd x_;
  Eigen::VectorXd weights_ = Eigen::VectorXd::LinSpaced(20, 0.5, 2.0);
};

TEST_P(LevelEnergyOfTwenty, GradientMatchesCentralDifferences) {
  for (const auto& [name, penalty] : kPenaltyNames) {
    SubspaceOptions options;
    options.penalty = penalty;
    const LevelEnergy energy(picture_, GetParam(), templates_, {history_, weights_}, options);
    const Eigen::Matrix2Xd gradient = energy.total().Gradient(OnLevel());
    const Eigen::Matrix2Xd numeric = test::NumericGradient(
        [&](const Eigen::Matrix2Xd& x) { return energy.total().Value(x); }, OnLevel(), 1e-4);
    // |.| and bilinear interpolation have kinks, which a difference now and then steps over.
    EXPECT_LT((gradient - numeric).norm(), 0.02 * gradient.norm()) << name;
  }
}

TEST_P(LevelEnergyOfTwenty, MinimumIsLowerAndNearerToTheTruth) {
  Eigen::Matrix2Xd truth = test::GridOfTwenty().colwise() + Eigen::Vector2d(1.3, -0.8);
  truth *= std::ldexp(1.0, -GetParam());
  SubspaceOptions options;
  options.penalty = PenaltyKind::kEmpiricalDimension;
  const LevelEnergy energy(picture_, GetParam(), templates_, {history_, weights_}, options);
  const OptimizerResult result = energy.Minimize(OnLevel());
  EXPECT_LT(energy.total().Value(result.x), energy.total().Value(OnLevel()));
  EXPECT_LT((result.x - truth).norm(), 0.5 * (OnLevel() - truth).norm());
}

INSTANTIATE_TEST_SUITE_P(Levels, LevelEnergyOfTwenty, testing::Values(0, 1));

TEST(LevelEnergy, WithoutHistoryEveryFeatureIsForItself) {
  const Pyramid picture = test::ShiftedNoise({0.7, 0.4});
  const Eigen::Matrix2Xd x = test::GridOfTwenty();
  const std::vector<Templates> templates = TemplatesAt(test::ShiftedNoise({0, 0}));
  const Eigen::VectorXd weights = Eigen::VectorXd::Ones(20);
  const LevelEnergy all(picture, 0, templates, {std::nullopt, weights}, {});
  const Eigen::Matrix2Xd together = all.Minimize(x).x;
  for (std::size_t f = 0; f < templates.size(); ++f) {
    const std::span<const Templates> one(&templates[f], 1);
    const LevelEnergy energy(picture, 0, one, {std::nullopt, weights.head(1)}, {});
    const auto column = static_cast<Eigen::Index>(f);
    EXPECT_EQ(energy.Minimize(x.col(column)).x, together.col(column));
  }
}

}  // namespace
}  // namespace cohort
