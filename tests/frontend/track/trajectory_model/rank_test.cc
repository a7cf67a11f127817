#include "frontend/track/trajectory_model/rank.h"

#include <gtest/gtest.h>

#include <Eigen/SVD>
#include <cmath>

#include "frontend/track/trajectory_model/feature_fit.h"
#include "frontend/track/trajectory_model/gauge.h"
#include "frontend/track/trajectory_model/joint_fit.h"
#include "tests/frontend/track/trajectory_model/small_scene.h"

namespace cohort::trajectory_model {
namespace {

constexpr int kFeatures = 60;
constexpr int kFrames = 12;
constexpr double kNoisePx = 0.3;

// A model of rank `rank`, fitted to features of which those with an own way move along it by
// `own_px` a frame, times a number of their own of mean 0 and variance 1.
State ModelOf(int rank,
              double own_px,
              std::uint64_t seed = 1,
              std::size_t with_own_way = kFeatures) {
  test::SmallScene scene = test::MakeSmallScene(kFeatures, kFrames, rank, true, kNoisePx, seed);
  RandomStream random(seed, "test/rank/own_way");
  for (std::size_t f = 0; f < with_own_way; ++f) {
    const double size = random.Gaussian();
    for (std::size_t l = 0; l < kFrames; ++l) {
      scene.state.frames[l].observations[f].xy.x() +=
          own_px * std::sin(0.9 * static_cast<double>(l)) * size;
    }
  }
  JointFit fit;
  for (int i = 0; i < 6; ++i) {
    fit.Step(scene.state);
    FitAllFeatures(scene.state);
    CenterDepths(scene.state);
    NormalizeCoordinates(scene.state);
  }
  return scene.state;
}

TEST(FitDirection, FindsAProductOfCameraAndFeature) {
  RandomStream random(2, "test/rank/product");
  Eigen::VectorXd v(kFeatures);
  for (double& entry : v) entry = random.Gaussian();
  Eigen::Matrix3Xd g(3, kFrames);
  for (Eigen::Index i = 0; i < g.size(); ++i) g.data()[i] = random.Gaussian();
  std::vector<WhitenedResidual> residuals;
  double sum_of_squares = 0.0;
  for (std::size_t l = 0; l < kFrames; ++l) {
    for (std::size_t f = 0; f < kFeatures; ++f) {
      WhitenedResidual w{l, f};
      for (Eigen::Index i = 0; i < w.J.size(); ++i) w.J.data()[i] = random.Gaussian();
      w.residual = w.J * g.col(static_cast<Eigen::Index>(l)) * v[static_cast<Eigen::Index>(f)];
      sum_of_squares += w.residual.squaredNorm();
      residuals.push_back(w);
    }
  }
  Eigen::VectorXd start = v;
  for (double& entry : start) entry += 0.5 * random.Gaussian();
  const Direction found = FitDirection(residuals, kFrames, true, start);
  EXPECT_NEAR(found.explained, sum_of_squares, 1e-3 * sum_of_squares);
  EXPECT_NEAR(std::abs(found.v.normalized().dot(v.normalized())), 1.0, 1e-4);
  EXPECT_NEAR(found.v.squaredNorm(), kFeatures, 1e-9);
}

TEST(FitDirection, OfAnAffineModelLeavesDepthAlone) {
  WhitenedResidual w;
  w.residual = {1.0, 2.0};
  w.J << 1.0, 0.0, -3.0, 0.0, 1.0, 5.0;
  const Direction found =
      FitDirection(std::vector<WhitenedResidual>{w}, 1, false, Eigen::VectorXd::Ones(1));
  EXPECT_LT(std::abs(found.g(2, 0)), 1e-4 * found.g.norm());
}

// The edge against the largest singular value of white noise, which is what it stands for.
TEST(EdgeOfNoise, IsWhereTheLargestSingularValueOfWhiteNoiseLies) {
  RandomStream random(3, "test/rank/edge");
  Eigen::MatrixXd noise(2 * 30, 200);
  for (Eigen::Index i = 0; i < noise.size(); ++i) noise.data()[i] = random.Gaussian();
  const double largest = Eigen::JacobiSVD<Eigen::MatrixXd>(noise).singularValues()[0];
  EXPECT_NEAR(largest * largest / EdgeOfNoise(200, 30, false), 1.0, 0.05);
}

TEST(AdaptRank, AddsWhatTheResidualsHaveInCommon) {
  for (const int rank : {2, 3}) {
    State state = ModelOf(rank, 2.0);
    const double before = MisfitOfFrame(state.frames[1], state.features);
    AdaptRank(state, 8);
    ASSERT_EQ(state.rank, rank + 1);
    for (const Frame& frame : state.frames) EXPECT_EQ(frame.camera.cols(), rank + 2);
    for (const FeaturePosterior& feature : state.features) {
      EXPECT_EQ(feature.mean.size(), rank + 3);
      EXPECT_EQ(feature.covariance.rows(), rank + 3);
    }
    EXPECT_LT(MisfitOfFrame(state.frames[1], state.features), 0.5 * before) << "rank " << rank;
  }
}

// Below three noise may: a rigid scene has three anyway.
TEST(AdaptRank, BeyondARigidScenesThreeTakesNoNoiseForACoordinate) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    State state = ModelOf(3, 0.0, seed);
    AdaptRank(state, 8);
    EXPECT_EQ(state.rank, 3) << "seed " << seed;
  }
}

TEST(AdaptRank, BeyondARigidScenesThreeAsksOnlyFeaturesThatWereObservedOften) {
  for (const std::size_t observed : {5u, 12u}) {  // of twelve frames
    constexpr std::size_t kOfBody = kFeatures / 3;
    State state = ModelOf(3, 0.0);
    const State body = ModelOf(3, 4.0, 1, kOfBody);
    for (std::size_t l = 0; l < kFrames; ++l) {
      for (std::size_t f = 0; f < kOfBody; ++f) {
        state.frames[l].observations[f] =
            l < observed ? body.frames[l].observations[f] : Observation{};
      }
    }
    FitAllFeatures(state);
    AdaptRank(state, 8);
    EXPECT_EQ(state.rank, observed == 12 ? 4 : 3);
  }
}

TEST(AdaptRank, StaysAtTheRankThatIsAllowed) {
  State state = ModelOf(2, 2.0);
  AdaptRank(state, 2);
  EXPECT_EQ(state.rank, 2);
}

TEST(AdaptRank, NeedsTwoFeaturesACoordinate) {
  State state = ModelOf(2, 2.0);
  state.features.resize(5);
  for (Frame& frame : state.frames) frame.observations.resize(5);
  AdaptRank(state, 8);
  EXPECT_EQ(state.rank, 2);
}

TEST(BeginWithPositions, ProjectsWhereTheFeaturesAre) {
  State state = test::MakeSmallScene(20, 1, 2, true, 0.05).state;
  state.features.assign(20, {});
  state.rank = 0;
  for (Observation& o : state.frames.front().observations) o.anchor = true;
  BeginWithPositions(state);
  EXPECT_EQ(state.rank, 2);
  for (std::size_t f = 0; f < 20; ++f) {
    const Frame& frame = state.frames.front();
    const Eigen::Vector2d xy = Project(frame.camera, state.features[f].mean).xy;
    EXPECT_LT((xy - frame.observations[f].xy).norm(), 0.01);
  }
}

}  // namespace
}  // namespace cohort::trajectory_model
