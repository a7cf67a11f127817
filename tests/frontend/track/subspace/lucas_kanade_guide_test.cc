#include "frontend/track/subspace/lucas_kanade_guide.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/moving_picture.h"

namespace cohort {
namespace {

class LucasKanadeGuideTest : public testing::Test {
 protected:
  LucasKanadeGuideTest() {
    guide_.Begin(first_);
    guide_.Add(std::vector<Eigen::Vector2d>{born_.colwise().begin(), born_.colwise().end()},
               first_);
  }

  Pyramid first_ = test::ShiftedNoise({0, 0});
  Eigen::Matrix2Xd born_ = test::GridOfTwenty();
  std::vector<std::uint8_t> confirmed_ = std::vector<std::uint8_t>(20, 1);
  LucasKanadeGuide guide_;
};

TEST_F(LucasKanadeGuideTest, FindsFeaturesThatMoveFarInOneFrame) {
  const Eigen::Vector2d motion(30, 10);
  const Eigen::Matrix2Xd found = guide_.Find(test::ShiftedNoise(motion), confirmed_);
  for (const Eigen::Index f : {6, 7, 12, 13}) {  // others leave the picture
    EXPECT_LT((found.col(f) - born_.col(f) - motion).norm(), 1.0) << f;
  }
}

TEST_F(LucasKanadeGuideTest, WhatIsNotConfirmedMovesWithTheOthers) {
  const Eigen::Vector2d motion(5, -3);
  confirmed_[7] = 0;
  const Eigen::Matrix2Xd found = guide_.Find(test::ShiftedNoise(motion), confirmed_);
  EXPECT_LT((found.col(7) - born_.col(7) - motion).norm(), 0.5);
}

TEST_F(LucasKanadeGuideTest, WhereNothingIsFoundAllMoveAlike) {
  Pyramid black;
  for (const cv::Mat& level : first_.levels) black.levels.emplace_back(0.0 * level);
  const Eigen::Matrix2Xd moved = guide_.Find(black, confirmed_) - born_;
  EXPECT_LT((moved.colwise() - moved.col(0).eval()).norm(), 1e-9);
}

TEST_F(LucasKanadeGuideTest, GoesOnFromWhereTheFeaturesTurnedOutToBe) {
  const Pyramid next = test::ShiftedNoise({4, 2});
  const Eigen::Matrix2Xd turned_out = born_.colwise() + Eigen::Vector2d(4, 2);
  guide_.Remember(next, turned_out, confirmed_);
  guide_.Keep(
      std::vector<std::uint8_t>{1, 0, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1});
  const Eigen::Matrix2Xd found =
      guide_.Find(next, std::span<const std::uint8_t>(confirmed_).first(19));
  ASSERT_EQ(found.cols(), 19);
  EXPECT_LT((found.col(1) - turned_out.col(2)).norm(), 0.05);
}

}  // namespace
}  // namespace cohort
