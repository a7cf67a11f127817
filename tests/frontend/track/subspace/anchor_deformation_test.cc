#include "frontend/track/subspace/anchor_deformation.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/moving_picture.h"

namespace cohort {
namespace {

// Scale 1.02, a turn of 0.05.
Eigen::Matrix2d TrueSimilarity() {
  Eigen::Matrix2d similarity;
  similarity << std::cos(0.05), -std::sin(0.05), std::sin(0.05), std::cos(0.05);
  return 1.02 * similarity;
}

TEST(CommonSimilarity, IsThatOfMostFeatures) {
  const Eigen::Matrix2Xd before = test::GridOfTwenty();
  Eigen::Matrix2Xd now = (TrueSimilarity() * before).colwise() + Eigen::Vector2d(30, -5);
  for (const int outlier : {3, 8, 14}) now.col(outlier) += Eigen::Vector2d(9, 4);
  const std::vector<MeasuredFeature> features(20);
  EXPECT_LT((CommonSimilarity(before, now, features) - TrueSimilarity()).norm(), 0.01);
}

TEST(CommonSimilarity, DoesNotAskWhatIsNotConfirmed) {
  const Eigen::Matrix2Xd before = test::GridOfTwenty();
  Eigen::Matrix2Xd now = TrueSimilarity() * before;
  std::vector<MeasuredFeature> features(20);
  for (int f = 0; f < 12; ++f) {
    now.col(f) = before.col(f);
    features[static_cast<std::size_t>(f)].confirmed = false;
  }
  EXPECT_TRUE(CommonSimilarity(before, now, features).isApprox(TrueSimilarity(), 1e-9));
}

TEST(CommonSimilarity, OfThreeFeaturesIsUnknown) {
  const Eigen::Matrix2Xd before = test::GridOfTwenty().leftCols(3);
  const Eigen::Matrix2Xd now = TrueSimilarity() * before;
  EXPECT_TRUE(CommonSimilarity(before, now, std::vector<MeasuredFeature>(3)).isIdentity());
}

TEST(DeformAnchors, CarriesWarpsAlongAndLeavesTheRestToTheMeasurement) {
  std::vector<MeasuredFeature> features(2);
  features[1].anchor.warp = 2.0 * Eigen::Matrix2d::Identity();
  DeformAnchors(TrueSimilarity(), 0.1, features);
  DeformAnchors(TrueSimilarity(), 0.1, features);
  const Eigen::Matrix2d twice = TrueSimilarity() * TrueSimilarity();
  EXPECT_TRUE(features[0].anchor.warp.isApprox(twice, 1e-12));
  EXPECT_TRUE(features[1].anchor.warp.isApprox(2.0 * twice, 1e-12));
  EXPECT_TRUE(
      features[0].anchor.warp_covariance.isApprox(0.02 * Eigen::Matrix4d::Identity(), 1e-12));
}

}  // namespace
}  // namespace cohort
