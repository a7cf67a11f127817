#include "frontend/track/trajectory_model/sized.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/trajectory_model/small_scene.h"

namespace cohort::trajectory_model {
namespace {

class SizedAtRank : public testing::TestWithParam<int> {};

// Sizes known when compiled change no figure: every rank projects as Project says, and has the
// covariance of J = [d xy / d z, I].
TEST_P(SizedAtRank, ProjectsAsAtAnySize) {
  test::SmallScene scene = test::MakeSmallScene(5, 3, 2, true, 0.5);
  RandomStream random(1, "test/sized");
  const int rank = GetParam();
  for (FeaturePosterior& feature : scene.state.features) {
    feature.mean = Vector::NullaryExpr(rank + 2, [&](Eigen::Index) { return random.Gaussian(); });
    const Matrix root =
        Matrix::NullaryExpr(rank + 2, rank + 2, [&](Eigen::Index) { return random.Gaussian(); });
    feature.covariance = root * root.transpose();
    for (std::size_t l = 0; l < scene.state.frames.size(); ++l) {
      Camera camera =
          Camera::NullaryExpr(3, rank + 1, [&](Eigen::Index) { return 10.0 * random.Gaussian(); });
      camera.row(2) *= 0.01;
      camera(2, 0) = 1.0;
      const Observation& o = scene.state.frames[l].observations[0];
      const Projection any = Project(camera, feature.mean);
      WithRank(rank, [&](auto r) {
        using S = Sized<r.value>;
        const auto mean = S::MeanOf(feature);
        const auto at = ProjectSized<r.value>(S::Of(camera), mean);
        EXPECT_LT((at.xy - any.xy).norm(), 1e-12 * any.xy.norm());
        EXPECT_LT((at.of_z - any.of_z).norm(), 1e-12 * any.of_z.norm());
        EXPECT_LT((at.OfHomogeneous() - any.of_homogeneous).norm(),
                  1e-12 * any.of_homogeneous.norm());
        EXPECT_LT((SizedResidual<r.value>(at, o, mean) - Residual(any, o, feature)).norm(), 1e-9);
        for (const bool with_anchor_error : {false, true}) {
          Jacobian J(2, rank + 2);
          J.leftCols(rank) = any.of_z;
          J.rightCols(2) = (with_anchor_error ? 1.0 : 0.0) * Eigen::Matrix2d::Identity();
          const Eigen::Matrix2d expected = J * feature.covariance * J.transpose();
          EXPECT_LT(
              (CovarianceOfPosition<r.value>(at.of_z, S::CovarianceOf(feature), with_anchor_error) -
               expected)
                  .norm(),
              1e-9 * expected.norm());
        }
      });
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Ranks, SizedAtRank, testing::Values(2, 3, 4, 7));

}  // namespace
}  // namespace cohort::trajectory_model
