#include "frontend/track/trajectory_model/joint_fit.h"

#include <gtest/gtest.h>

#include "frontend/track/trajectory_model/camera_fit.h"
#include "frontend/track/trajectory_model/feature_fit.h"
#include "tests/frontend/track/trajectory_model/small_scene.h"

namespace cohort::trajectory_model {
namespace {

// Cameras and coordinates off by some pixels. The cameras' error is what alternation is slow at:
// each of them is off, and the coordinates with them.
State Disturbed(std::uint64_t seed, double px) {
  State state = test::MakeSmallScene(40, 8, 3, true, 0.05, seed).state;
  RandomStream random(seed, "test/joint_fit/start");
  for (Frame& frame : state.frames) {
    for (Eigen::Index p = 0; p < 4; ++p) {
      frame.camera.col(p).head<2>() += px * Eigen::Vector2d(random.Gaussian(), random.Gaussian());
      if (p > 0) frame.camera(2, p) += 1e-3 * px * random.Gaussian();
    }
  }
  for (FeaturePosterior& feature : state.features) {
    for (Eigen::Index i = 0; i < 3; ++i) feature.mean[i] += 0.01 * px * random.Gaussian();
  }
  return state;
}

double RootMeanSquare(const State& state) {
  double square = 0.0;
  for (const Frame& frame : state.frames) {
    for (std::size_t f = 0; f < state.features.size(); ++f) {
      const FeaturePosterior& feature = state.features[f];
      const Projection at = Project(frame.camera, feature.mean);
      square += Residual(at, frame.observations[f], feature).squaredNorm();
    }
  }
  const auto count = static_cast<double>(state.frames.size() * state.features.size());
  return std::sqrt(square / (2.0 * count));
}

double CostOfAll(const State& state) {
  double cost = 0.0;
  for (std::size_t f = 0; f < state.features.size(); ++f) {
    const Eigen::Matrix2d anchor = EquationsOfFeature(state, f, Noise::kStudent).anchor_information;
    cost += CostOfFeature(state, f, anchor, Noise::kStudent);
  }
  return cost;
}

TEST(JointFit, ReachesTheNoiseInAFewSteps) {
  State state = Disturbed(1, 2.0);
  ASSERT_GT(RootMeanSquare(state), 2.0);
  State alternated = state;
  JointFit fit;
  for (int i = 0; i < 8; ++i) fit.Step(state);
  EXPECT_LT(RootMeanSquare(state), 0.055);
  for (int i = 0; i < 8; ++i) {
    FitAllFeatures(alternated);
    for (Frame& frame : alternated.frames) RefitCamera(alternated, frame);
  }
  EXPECT_GT(RootMeanSquare(alternated), RootMeanSquare(state));
}

TEST(JointFit, NeverRaisesTheCost) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    State state = Disturbed(seed, 20.0);
    JointFit fit;
    for (int i = 0; i < 6; ++i) {
      for (Frame& frame : state.frames) frame.misfit = MisfitOfFrame(frame, state.features);
      const double before = CostOfAll(state);
      fit.Step(state);
      EXPECT_LE(CostOfAll(state), before * (1.0 + 1e-12)) << "seed " << seed << ", step " << i;
    }
  }
}

TEST(JointFit, MovesOnlyTheNewestCameras) {
  State state = test::MakeSmallScene(20, 16, 3, true, 0.5).state;
  const State before = state;
  JointFit fit;
  fit.Step(state);
  EXPECT_NE(state.frames[0].camera, before.frames[0].camera);
  for (std::size_t l = JointFit::FramesOf(state); l < 16; ++l) {
    EXPECT_EQ(state.frames[l].camera, before.frames[l].camera) << l;
  }
}

}  // namespace
}  // namespace cohort::trajectory_model
