#include "frontend/track/measure/there_and_back.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/moving_picture.h"

namespace cohort {
namespace {

const Eigen::Vector2d kMotion(6, -4);

// All features of the grid but the sixth, from a picture to the next one.
std::vector<Feature> Tracked(double max_open_px, const Pyramid& next) {
  const Pyramid first = test::ShiftedNoise({0, 0});
  std::vector<Feature> features = test::FeaturesAt(first, test::GridOfTwenty());
  features[4].open = false;
  features[6].returned_xy = {1, 1};  // of an earlier frame
  ThereAndBack there_and_back(max_open_px);
  there_and_back.Remember(first);
  std::vector<std::size_t> asked;
  for (std::size_t f = 0; f < features.size(); ++f) {
    if (f != 5) asked.push_back(f);
  }
  there_and_back.Track(next, test::GridOfTwenty(), asked, features);
  return features;
}

TEST(ThereAndBack, FindsWhatItIsAskedForWhereItWent) {
  const std::vector<Feature> features = Tracked(1.5, test::ShiftedNoise(kMotion));
  EXPECT_FALSE(features[5].returned_xy);
  for (const std::size_t f : {4u, 6u, 7u, 12u, 13u}) {
    ASSERT_TRUE(features[f].returned_xy) << f;
    const Eigen::Vector2d xy = test::GridOfTwenty().col(static_cast<Eigen::Index>(f)) + kMotion;
    EXPECT_LT((*features[f].returned_xy - xy).norm(), 0.1) << f;
  }
}

TEST(ThereAndBack, WhatIsGoneDoesNotComeBack) {
  const Pyramid other = BuildPyramid(test::ImageOf(
      [](double x, double y) { return test::NoiseAt(3.1 * x - 900, 2000 - y); }, 240, 180, CV_32F));
  int returned = 0;
  for (const Feature& feature : Tracked(1.5, other)) returned += feature.returned_xy ? 1 : 0;
  EXPECT_LE(returned, 5);  // of 19: by chance
}

// A picture's half away the guide is lost; what looks like its template decides, feature by
// feature.
TEST(ThereAndBack, IsTheStartWhereTheGuideIsElsewhereAndLooksWorse) {
  const Eigen::Vector2d far_motion(30, 10);
  const Pyramid next = test::ShiftedNoise(far_motion);
  const std::vector<Feature> features = Tracked(1.5, next);
  const Eigen::Matrix2Xd truth = test::GridOfTwenty().colwise() + far_motion;
  Eigen::Matrix2Xd guide = test::GridOfTwenty();  // has not moved
  guide.col(7) = truth.col(7) + Eigen::Vector2d(1, 1);
  const Eigen::Matrix2Xd starts = ThereAndBack::BetterStarts(next, guide, features, 11);
  EXPECT_LT((starts.col(6) - truth.col(6)).norm(), 0.2);
  EXPECT_EQ(starts.col(7), guide.col(7)) << "near enough";
  EXPECT_EQ(starts.col(5), guide.col(5)) << "was not asked for";
  // Where the guide is right, what Lucas-Kanade says elsewhere does not look like the template.
  std::vector<Feature> misled = features;
  misled[6].returned_xy = truth.col(6) + Eigen::Vector2d(9, -9);
  EXPECT_EQ(ThereAndBack::BetterStarts(next, truth, misled, 11).col(6), truth.col(6));
}

TEST(ThereAndBack, OpenIsWhatTheOthersKnowWorseThanTheLimit) {
  TrajectoryModel::Estimate predicted;
  predicted.measured_covariance = 1.4 * 1.4 * Eigen::Matrix2d::Identity();
  EXPECT_FALSE(ThereAndBack(1.5).IsOpen(predicted));
  predicted.measured_covariance = 1.6 * 1.6 * Eigen::Matrix2d::Identity();
  EXPECT_TRUE(ThereAndBack(1.5).IsOpen(predicted));
  EXPECT_FALSE(ThereAndBack(0.0).IsOpen(predicted));
}

}  // namespace
}  // namespace cohort
