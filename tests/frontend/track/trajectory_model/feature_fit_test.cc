#include "frontend/track/trajectory_model/feature_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "tests/frontend/track/trajectory_model/small_scene.h"
#include "tests/support/numeric_gradient.h"

namespace cohort::trajectory_model {
namespace {

TEST(FeatureEquations, GradientIsThatOfTheCost) {
  for (const Noise noise : {Noise::kGaussian, Noise::kStudent}) {
    test::SmallScene scene = test::MakeSmallScene(1, 8, 3, true, 0.5);
    FeaturePosterior& feature = scene.state.features[0];
    feature.mean += Vector::Constant(5, 0.003);  // off the minimum
    scene.state.frames[5].observations[0].anchor = true;
    const FeatureEquations equations = EquationsOfFeature(scene.state, 0, noise);
    const Vector numeric = cohort::test::NumericGradient(
        [&](const Vector& mean) {
          State moved = scene.state;
          moved.features[0].mean = mean;
          return CostOfFeature(moved, 0, equations.anchor_information, noise);
        },
        feature.mean,
        1e-6);
    // The cost is twice the negative logarithm: its derivative is -2 times the gradient.
    EXPECT_LT((numeric + 2.0 * equations.gradient).norm(), 1e-4 * equations.gradient.norm());
    const auto [same, cost] = EquationsAndCostOfFeature(scene.state, 0, noise);
    EXPECT_EQ(same.gradient, equations.gradient);
    EXPECT_DOUBLE_EQ(cost, CostOfFeature(scene.state, 0, equations.anchor_information, noise));
  }
}

// With an affine camera the posterior is that of a linear problem.
TEST(FitFeature, OfAnAffineModelIsTheLinearPosterior) {
  test::SmallScene scene = test::MakeSmallScene(1, 10, 3, false, 0.5);
  scene.state.features[0] = {};
  // Student's t makes the weights depend on residuals: anchors alone are Gaussian.
  for (Frame& frame : scene.state.frames) frame.observations[0].anchor = true;
  FitFeature(scene.state, 0);
  Matrix information = Matrix::Identity(3, 3);
  Vector gradient = Vector::Zero(3);
  for (const Frame& frame : scene.state.frames) {
    const Observation& o = frame.observations[0];
    const Jacobian B = frame.camera.topRightCorner(2, 3);
    information += B.transpose() * o.information * B;
    gradient += B.transpose() * o.information * (o.xy - frame.camera.topLeftCorner<2, 1>());
  }
  const FeaturePosterior& feature = scene.state.features[0];
  EXPECT_LT((feature.mean.head(3) - information.llt().solve(gradient)).norm(), 1e-9);
  const Matrix identity = Matrix::Identity(3, 3);
  EXPECT_LT((feature.covariance.topLeftCorner(3, 3) - information.llt().solve(identity)).norm(),
            1e-9);
}

TEST(FitFeature, OneWrongMeasurementHasLittleSay) {
  test::SmallScene scene = test::MakeSmallScene(1, 20, 3, true, 0.2);
  FitFeature(scene.state, 0);
  const Vector before = scene.state.features[0].mean;
  scene.state.frames[7].observations[0].xy += Eigen::Vector2d(20.0, 0.0);
  for (int i = 0; i < 10; ++i) FitFeature(scene.state, 0);
  const Camera& newest = scene.state.frames[0].camera;
  const double moved_px =
      (Project(newest, scene.state.features[0].mean).xy - Project(newest, before).xy).norm();
  EXPECT_LT(moved_px, 0.2) << "20 px in one of 20 frames would move a mean by 1";
}

TEST(FitFeature, NeverRaisesTheCost) {
  RandomStream random(4, "test/feature_fit/start");
  test::SmallScene scene = test::MakeSmallScene(30, 12, 3, true, 0.3);
  for (std::size_t f = 0; f < 30; ++f) {
    // Far off, so that full steps cross the camera's plane at infinity.
    for (double& entry : scene.state.features[f].mean) entry += random.Uniform(-6, 6);
    const Eigen::Matrix2d anchor =
        EquationsOfFeature(scene.state, f, Noise::kStudent).anchor_information;
    double cost = CostOfFeature(scene.state, f, anchor, Noise::kStudent);
    for (int i = 0; i < 5; ++i) {
      FitFeature(scene.state, f);
      const double now = CostOfFeature(scene.state, f, anchor, Noise::kStudent);
      EXPECT_LE(now, cost);
      cost = now;
    }
  }
}

}  // namespace
}  // namespace cohort::trajectory_model
