#include "frontend/track/trajectory_model/prediction.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>

#include "tests/frontend/track/trajectory_model/small_scene.h"

namespace cohort::trajectory_model {
namespace {

// Draws cameras and features from what is said of them, and compares the scatter of projections.
TEST(PredictFeature, CovarianceIsTheScatterOfDraws) {
  RandomStream random(5, "test/prediction/draws");
  constexpr Eigen::Index kRank = 3;
  constexpr int kDraws = 20000;
  const auto covariance_of = [&](Eigen::Index n, double sigma) {  // correlated at random
    Eigen::MatrixXd root(n, n);
    for (Eigen::Index i = 0; i < root.size(); ++i) root.data()[i] = sigma * random.Gaussian();
    return Eigen::MatrixXd(root * root.transpose());
  };
  const auto draw = [&](const Eigen::MatrixXd& covariance) {
    Eigen::VectorXd gaussian(covariance.rows());
    for (double& entry : gaussian) entry = random.Gaussian();
    return Eigen::VectorXd(covariance.llt().matrixL() * gaussian);
  };
  CameraFit fit;
  fit.camera = test::MovingCamera(10, kRank, true);
  Eigen::VectorXd sigmas = Eigen::VectorXd::Ones(3 * (kRank + 1));
  for (Eigen::Index p = 0; p <= kRank; ++p) sigmas[3 * p + 2] = 0.005;  // depth, not pixels
  fit.covariance = sigmas.asDiagonal() * covariance_of(3 * (kRank + 1), 0.1) * sigmas.asDiagonal();
  FeaturePosterior feature;
  feature.mean = Vector::Zero(kRank + 2);
  feature.mean << 0.5, -0.8, 0.6, 0.2, -0.1;
  Eigen::VectorXd scales(kRank + 2);
  scales << 0.01, 0.01, 0.03, 0.5, 0.5;
  feature.covariance = scales.asDiagonal() * covariance_of(kRank + 2, 0.5) * scales.asDiagonal();

  const Estimate estimate = PredictFeature(fit, feature);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d measured_scatter = Eigen::Matrix2d::Zero();
  for (int i = 0; i < kDraws; ++i) {
    CameraFit drawn = fit;
    drawn.camera.reshaped() += draw(fit.covariance);
    const Vector unknowns = feature.mean + draw(feature.covariance);
    const Eigen::Vector2d xy = Project(drawn.camera, unknowns).xy;
    const Eigen::Vector2d d = xy - estimate.xy;
    const Eigen::Vector2d measured = xy + unknowns.tail<2>() - estimate.expected_xy;
    scatter += d * d.transpose() / kDraws;
    measured_scatter += measured * measured.transpose() / kDraws;
  }
  EXPECT_LT((scatter - estimate.covariance).norm(), 0.05 * estimate.covariance.norm());
  EXPECT_LT((measured_scatter - estimate.measured_covariance).norm(),
            0.05 * estimate.measured_covariance.norm());
}

TEST(PredictFeature, AllowsForDepthUntilTheModelHasIt) {
  const auto variance = [](int rank) {
    const test::SmallScene scene = test::MakeSmallScene(1, 5, rank, true, 0.1);
    CameraFit fit{scene.state.frames.front().camera,
                  Eigen::MatrixXd::Zero(3 * rank + 3, 3 * rank + 3)};
    FeaturePosterior feature = scene.state.features[0];
    feature.covariance.setZero();
    return PredictFeature(fit, feature).covariance.trace();
  };
  EXPECT_GT(variance(2), 2.0);
  EXPECT_EQ(variance(3), 0.0);
}

// Monte Carlo over the noise of a frame in which half of the features are measured: the errors of
// the others' predictions, over the covariances that are said for them.
TEST(FitNewCamera, PredictsAsWellAsItSays) {
  constexpr std::size_t kFeatures = 40;
  constexpr std::uint64_t kDraws = 60;
  double normalised = 0.0;
  std::size_t count = 0;
  for (std::uint64_t seed = 1; seed <= kDraws; ++seed) {
    test::SmallScene scene = test::MakeSmallScene(kFeatures, 8, 3, true, 0.5, seed);
    RandomStream random(seed, "test/prediction/frame");
    // What is known of the features: the truth, off by what is said of it.
    for (FeaturePosterior& feature : scene.state.features) {
      feature.covariance = Matrix::Zero(5, 5);
      feature.covariance.diagonal() << 4e-6, 4e-6, 1e-3, 0.04, 0.04;
      for (Eigen::Index i = 0; i < 3; ++i) {
        feature.mean[i] += std::sqrt(feature.covariance(i, i)) * random.Gaussian();
      }
    }
    const Camera camera = test::MovingCamera(8, 3, true);
    std::vector<Observation> now(kFeatures);
    for (std::size_t f = 0; f < kFeatures / 2; ++f) {
      const Eigen::Vector2d e(0.2 * random.Gaussian(), 0.2 * random.Gaussian());  // the anchor's
      now[f] = test::Measured(Project(camera, scene.z[f]).xy + e, scene.noise_px, random);
    }
    const CameraFit fit = FitNewCamera(scene.state, now);
    for (std::size_t f = kFeatures / 2; f < kFeatures; ++f) {
      const Estimate estimate = PredictFeature(fit, scene.state.features[f]);
      const Eigen::Vector2d d = Project(camera, scene.z[f]).xy - estimate.xy;
      normalised += d.dot(estimate.covariance.inverse() * d) / 2.0;
      ++count;
    }
  }
  // 1 in expectation; Student's weights take a Gaussian's measurements for a little less certain.
  EXPECT_GT(normalised / static_cast<double>(count), 0.7);
  EXPECT_LT(normalised / static_cast<double>(count), 1.5);
}

TEST(FitNewCamera, IsNotLedByFeaturesThatGoTheirOwnWay) {
  test::SmallScene scene = test::MakeSmallScene(40, 8, 3, true, 0.2);
  RandomStream random(6, "test/prediction/outliers");
  const Camera camera = test::MovingCamera(8, 3, true);
  std::vector<Observation> now;
  for (const Vector& z : scene.z) {
    now.push_back(test::Measured(Project(camera, z).xy, scene.noise_px, random));
  }
  for (std::size_t f = 0; f < 8; ++f) now[f].xy += Eigen::Vector2d(7.0, -5.0);
  const CameraFit fit = FitNewCamera(scene.state, now);
  for (const Vector& z : scene.z) {
    EXPECT_LT((Project(fit.camera, z).xy - Project(camera, z).xy).norm(), 0.6);
  }
}

}  // namespace
}  // namespace cohort::trajectory_model
