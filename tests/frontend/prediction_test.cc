// The affine model of the cohort on trajectories in closed form: points at several depths before a
// camera that moves sideways and shakes, under which image positions are exactly affine in 1/depth.

#include "frontend/track/prediction.h"

#include <gtest/gtest.h>

#include <cmath>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr Eigen::Index kFeatures = 120;

struct Scene {
  Eigen::Matrix2Xd rest{2, kFeatures};       // where a far point is seen in frame 0 [px]
  Eigen::VectorXd inverse_depth{kFeatures};  // 0.1 .. 1
};

Scene MakeScene() {
  RandomStream random(5, "test/prediction/scene");
  Scene scene;
  for (Eigen::Index f = 0; f < kFeatures; ++f) {
    scene.rest.col(f) = Eigen::Vector2d(random.Uniform(0, 640), random.Uniform(0, 480));
    scene.inverse_depth[f] = random.Uniform(0.1, 1.0);
  }
  return scene;
}

// Lateral motion by 6 px a frame at inverse depth 1, and shake of the whole picture.
Eigen::Matrix2Xd At(const Scene& scene, double t) {
  Eigen::Matrix2Xd x = scene.rest;
  x.row(0) += (6.0 * t * scene.inverse_depth).transpose();
  x.colwise() += Eigen::Vector2d(8.0 * std::sin(1.3 * t), 6.0 * std::cos(0.7 * t));
  return x;
}

// Frames 0 .. `frames` - 1, newest first, with noise.
CohortHistory HistoryOf(const Scene& scene, int frames, double noise_px) {
  RandomStream random(6, "test/prediction/noise");
  CohortHistory history;
  for (int t = 0; t < frames; ++t) {
    Eigen::Matrix2Xd x = At(scene, t);
    for (Eigen::Index i = 0; i < x.size(); ++i) x.data()[i] += noise_px * random.Gaussian();
    history.positions.push_front(x);
    history.seen.emplace_front(kFeatures, std::uint8_t{1});
  }
  return history;
}

const std::vector<std::uint8_t> kAllTrusted(kFeatures, 1);

TEST(CohortPrediction, OfARigidSceneIsExactWithoutNoise) {
  const Scene scene = MakeScene();
  const auto p = PredictCohort(HistoryOf(scene, 10, 0.0), 10, At(scene, 10), kAllTrusted);
  ASSERT_TRUE(p);
  EXPECT_LT((p->x - At(scene, 10)).cwiseAbs().maxCoeff(), 0.02);
}

TEST(CohortPrediction, TellsFeaturesThatGoTheirOwnWay) {
  const Scene scene = MakeScene();
  Eigen::Matrix2Xd x = At(scene, 10);
  for (Eigen::Index f = 0; f < 30; ++f) x.col(f) += Eigen::Vector2d(7.0, -5.0);
  const auto p = PredictCohort(HistoryOf(scene, 10, 0.2), 10, x, kAllTrusted);
  ASSERT_TRUE(p);
  EXPECT_LT((p->x - At(scene, 10)).colwise().norm().maxCoeff(), 1.0);
  EXPECT_LT(p->spread_px, 0.5);
}

TEST(CohortPrediction, NeedsEightTrustedFeatures) {
  const Scene scene = MakeScene();
  std::vector<std::uint8_t> trusted(kFeatures, 0);
  std::fill(trusted.begin(), trusted.begin() + 7, std::uint8_t{1});
  EXPECT_FALSE(PredictCohort(HistoryOf(scene, 10, 0.0), 10, At(scene, 10), trusted));
  trusted[7] = 1;
  EXPECT_TRUE(PredictCohort(HistoryOf(scene, 10, 0.0), 10, At(scene, 10), trusted));
}

TEST(FeaturePrediction, HoldsAHiddenFeatureByItsCourseBeforeThat) {
  const Scene scene = MakeScene();
  constexpr double kNoisePx = 0.3;
  for (const int hidden_frames : {1, 5, 10}) {
    CohortHistory history = HistoryOf(scene, 20, kNoisePx);
    double square = 0.0;
    double expected = 0.0;
    int count = 0;
    for (Eigen::Index f = 0; f < 40; ++f) {
      CohortHistory own = history;
      for (int l = 0; l < hidden_frames; ++l) {  // what stood in front of it was taken for it
        own.seen[static_cast<std::size_t>(l)][static_cast<std::size_t>(f)] = 0;
        own.positions[static_cast<std::size_t>(l)].col(f) += Eigen::Vector2d(30.0, 10.0);
      }
      std::vector<std::uint8_t> trusted = kAllTrusted;
      trusted[static_cast<std::size_t>(f)] = 0;
      const auto p = PredictFeature(own, 20, At(scene, 20), trusted, f);
      ASSERT_TRUE(p);
      square += (p->xy - At(scene, 20).col(f)).squaredNorm();
      expected += 2.0 * p->sigma_px * p->sigma_px;
      ++count;
    }
    EXPECT_LT(std::sqrt(square / count), 2.0 * kNoisePx) << hidden_frames << " frames hidden";
    EXPECT_LT(square, 2.5 * expected) << "the expected error is too small";
    EXPECT_GT(square, 0.2 * expected) << "the expected error is too large";
  }
}

TEST(FeaturePrediction, OfANewFeatureFollowsItsNeighbours) {
  const Scene scene = MakeScene();
  CohortHistory history = HistoryOf(scene, 10, 0.1);
  for (std::size_t l = 1; l < 10; ++l) history.seen[l][0] = 0;
  std::vector<std::uint8_t> trusted = kAllTrusted;
  trusted[0] = 0;
  const auto p = PredictFeature(history, 20, At(scene, 10), trusted, 0);
  ASSERT_TRUE(p);
  // Its depth is not known yet: neighbours are up to 5 px a frame apart in parallax.
  EXPECT_LT((p->xy - At(scene, 10).col(0)).norm(), 5.0);
}

TEST(FeaturePrediction, KnowsNothingOfAFeatureThatWasNeverSeen) {
  const Scene scene = MakeScene();
  CohortHistory history = HistoryOf(scene, 10, 0.1);
  for (auto& seen : history.seen) seen[0] = 0;
  EXPECT_FALSE(PredictFeature(history, 20, At(scene, 10), kAllTrusted, 0));
}

}  // namespace
}  // namespace cohort
