#include "frontend/image/exposure.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "tests/frontend/track/moving_picture.h"

namespace cohort {
namespace {

cv::Mat InLight(const cv::Mat& picture, double gain, double offset) {
  return gain * picture + offset;
}

TEST(Exposure, FindsGainAndOffsetAlsoWhereTheCameraMoves) {
  const cv::Mat first = test::ShiftedNoise({0, 0}).levels[0];
  for (const Eigen::Vector2d& motion : {Eigen::Vector2d(0, 0), Eigen::Vector2d(8, -8)}) {
    const cv::Mat second = InLight(test::ShiftedNoise(motion).levels[0], 0.6, 0.05);
    const auto change = EstimateLightChange(BuildPyramid(first), BuildPyramid(second));
    ASSERT_TRUE(change);
    EXPECT_NEAR(change->gain, 0.6, 0.02);
    EXPECT_NEAR(change->offset, 0.05, 0.01);
  }
}

TEST(Exposure, BringsEveryFrameToTheLightOfTheFirst) {
  Exposure exposure;
  const cv::Mat first = test::ShiftedNoise({0, 0}).levels[0];
  exposure.Follow(first);
  for (const double gain : {0.8, 0.5, 0.7}) {
    const cv::Mat dimmed = InLight(first, gain, 0.1);
    const cv::Mat steady = WithoutLight(dimmed, exposure.Follow(dimmed));
    EXPECT_LT(cv::norm(steady, first, cv::NORM_INF), 0.02) << gain;
  }
}

TEST(Exposure, SteadyLightKeepsThePictures) {
  Exposure exposure;
  for (const Eigen::Vector2d& motion : {Eigen::Vector2d(0, 0), Eigen::Vector2d(3, 2)}) {
    const cv::Mat picture = test::ShiftedNoise(motion).levels[0];
    const cv::Mat steady = WithoutLight(picture, exposure.Follow(picture));
    EXPECT_EQ(steady.data, picture.data);
  }
}

// A black frame tells of no light, and is none to bring the others to.
TEST(Exposure, ABlackFrameChangesNothing) {
  Exposure exposure;
  const cv::Mat picture = test::ShiftedNoise({0, 0}).levels[0];
  const cv::Mat black(picture.size(), CV_32F, cv::Scalar(0.001));
  exposure.Follow(black);
  EXPECT_EQ(exposure.Follow(picture).gain, 1.0);
  exposure.Follow(black);
  EXPECT_NEAR(exposure.Follow(InLight(picture, 0.6, 0.0)).gain, 0.6, 0.01);
}

// A ramp of less than what is a change from frame to frame.
TEST(Exposure, SlowChangesAddUp) {
  Exposure exposure;
  const cv::Mat picture = test::ShiftedNoise({0, 0}).levels[0];
  double gain = 1.0;
  for (int frame = 0; frame < 40; ++frame, gain *= 0.98) {
    EXPECT_NEAR(exposure.Follow(InLight(picture, gain, 0.0)).gain / gain, 1.0, 0.05) << frame;
  }
}

// Lamps on alternating current: errors of single frames must not add up.
TEST(Exposure, FlickerComesBackToWhereItBegan) {
  Exposure exposure;
  for (int frame = 0; frame < 100; ++frame) {
    const cv::Mat picture = test::ShiftedNoise({0.3 * (frame % 7), -0.2 * (frame % 5)}).levels[0];
    const double gain = frame % 2 == 0 ? 1.0 : 0.8;
    EXPECT_NEAR(exposure.Follow(InLight(picture, gain, 0.0)).gain, gain, 0.03) << frame;
  }
}

TEST(Exposure, LightIsFollowedInTheDark) {
  const cv::Mat picture = test::ShiftedNoise({0, 0}).levels[0];
  Exposure exposure;
  exposure.Follow(picture);
  EXPECT_NEAR(exposure.Follow(InLight(picture, 0.15, 0.0)).gain, 0.15, 0.01);
  EXPECT_NEAR(exposure.Follow(InLight(picture, 0.15, 0.0)).gain, 0.15, 0.01);
  EXPECT_NEAR(exposure.Follow(InLight(picture, 0.1, 0.0)).gain, 0.1, 0.01);
  Exposure in_the_dark;
  in_the_dark.Follow(InLight(picture, 0.15, 0.0));
  EXPECT_NEAR(in_the_dark.Follow(InLight(picture, 0.3, 0.0)).gain, 2.0, 0.05);
}

// Values of which 8 bits would show nothing: the steps of the intensities decide, not white.
TEST(Exposure, LightIsFollowedWhereOnly16BitsShowIt) {
  cv::Mat dim;
  test::ShiftedNoise({0, 0}).levels[0].convertTo(dim, CV_16U, 400.0);
  Exposure exposure;
  exposure.Follow(dim);
  cv::Mat bright;
  dim.convertTo(bright, CV_16U, 3.0);
  const LightChange& light = exposure.Follow(bright);
  EXPECT_NEAR(light.gain, 3.0, 0.05);
  Frame frame;
  frame.gray = bright;
  EXPECT_NEAR(WithoutLight(frame, light).float_step * 65535.0, 1.0 / 3.0, 0.01);
}

// What is in view after a cut is another scene: nothing is known of its light.
TEST(Exposure, AnotherSceneKeepsTheLight) {
  const cv::Mat picture = test::ShiftedNoise({0, 0}).levels[0];
  cv::Mat other;
  cv::flip(picture, other, -1);
  EXPECT_FALSE(EstimateLightChange(BuildPyramid(picture), BuildPyramid(InLight(other, 0.5, 0.1))));
}

}  // namespace
}  // namespace cohort
