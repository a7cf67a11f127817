#include "frontend/track/measure/there_and_back.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/moving_picture.h"

namespace cohort {
namespace {

// The picture moves further than a joint guide reaches.
class BetterStartsTest : public testing::Test {
 protected:
  // All features of the grid but the sixth are tried.
  Eigen::Matrix2Xd Starts(const Pyramid& next, const Eigen::Matrix2Xd& guided) const {
    std::vector<std::size_t> tried;
    for (std::size_t f = 0; f < features_.size(); ++f) {
      if (f != 5) tried.push_back(f);
    }
    return BetterStarts(first_, next, test::GridOfTwenty(), guided, tried, features_, 11);
  }

  const Eigen::Vector2d motion_{30, 10};
  Pyramid first_ = test::ShiftedNoise({0, 0});
  std::vector<Feature> features_ = test::FeaturesAt(first_, test::GridOfTwenty());
  Pyramid next_ = test::ShiftedNoise(motion_);
  Eigen::Matrix2Xd truth_ = test::GridOfTwenty().colwise() + motion_;
};

TEST_F(BetterStartsTest, AreLucasKanadesWhereTheGuideHasNotMoved) {
  const Eigen::Matrix2Xd guided = test::GridOfTwenty();
  const Eigen::Matrix2Xd starts = Starts(next_, guided);
  for (const Eigen::Index f : {6, 7, 12, 13}) {
    EXPECT_LT((starts.col(f) - truth_.col(f)).norm(), 0.2) << f;
  }
  EXPECT_EQ(starts.col(5), guided.col(5)) << "was not tried";
}

TEST_F(BetterStartsTest, AreTheGuidesWhereThatIsNear) {
  Eigen::Matrix2Xd guided = test::GridOfTwenty();
  guided.col(7) = truth_.col(7) + Eigen::Vector2d(1, 1);
  EXPECT_EQ(Starts(next_, guided).col(7), guided.col(7));
}

TEST_F(BetterStartsTest, AreTheGuidesWhereThatLooksMoreLikeTheTemplate) {
  // The picture before moved elsewhere, so Lucas-Kanade finds each feature's neighbourhood at a
  // wrong place.
  const Eigen::Vector2d elsewhere(9, -9);
  const Pyramid misleading = test::ShiftedNoise(elsewhere);
  const Eigen::Matrix2Xd starts = BetterStarts(
      misleading, next_, test::GridOfTwenty(), truth_, std::vector<std::size_t>{6}, features_, 11);
  EXPECT_EQ(starts.col(6), truth_.col(6));
}

TEST_F(BetterStartsTest, AreTheGuidesWhereThePictureShowsSomethingElse) {
  const Pyramid other = BuildPyramid(test::ImageOf(
      [](double x, double y) { return test::NoiseAt(3.1 * x - 900, 2000 - y); }, 240, 180, CV_32F));
  const Eigen::Matrix2Xd guided = test::GridOfTwenty();
  const Eigen::Matrix2Xd starts = Starts(other, guided);
  int moved = 0;
  for (Eigen::Index f = 0; f < 20; ++f) moved += starts.col(f) == guided.col(f) ? 0 : 1;
  EXPECT_LE(moved, 5) << "of 19, by chance";
}

}  // namespace
}  // namespace cohort
