#include "pipelines/sfm/repeated_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace cohort {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Picture number n of a camera that moves over a texture by `px` per picture, with noise of its
// own.
cv::Mat PictureAt(double n, double px, double noise, std::uint64_t seed) {
  static const cv::Mat texture = [] {
    cv::Mat random(400, 800, CV_32FC1);
    cv::RNG(7).fill(random, cv::RNG::NORMAL, 0.0, 300.0);
    cv::GaussianBlur(random, random, {}, 4.0);
    return cv::Mat(random + 110.0);
  }();
  const cv::Mat shift = (cv::Mat_<double>(2, 3) << 1, 0, -px * n, 0, 1, 0);
  cv::Mat picture;
  cv::warpAffine(texture, picture, shift, {320, 256});
  cv::Mat random(picture.size(), CV_32FC1);
  cv::RNG(1000 + seed).fill(random, cv::RNG::NORMAL, 0.0, noise);
  picture += random;
  picture.convertTo(picture, CV_8U);
  return picture;
}

// Changes of a clip that shows these pictures; `codec` adds noise to every shown frame anew.
std::vector<FrameChange> ChangesOf(const std::vector<int>& pictures,
                                   double px,
                                   double noise,
                                   double codec) {
  std::vector<FrameChange> changes;
  cv::Mat before;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    cv::Mat shown = PictureAt(pictures[i], px, noise, static_cast<std::uint64_t>(pictures[i]));
    cv::Mat random(shown.size(), CV_16SC1);
    cv::RNG(5000 + i).fill(random, cv::RNG::NORMAL, 0.0, codec);
    cv::add(shown, random, shown, cv::noArray(), CV_8U);
    if (i > 0) changes.push_back(ChangeBetween(before, shown));
    before = shown;
  }
  return changes;
}

std::vector<int> Shown(int frames, int pictures, int of) {
  std::vector<int> shown;
  for (int i = 0; i < frames; ++i) shown.push_back(i * pictures / of);
  return shown;
}

std::vector<std::size_t> CopiesIn(const std::vector<int>& shown) {
  std::vector<std::size_t> copies;
  for (std::size_t i = 1; i < shown.size(); ++i) {
    if (shown[i] == shown[i - 1]) copies.push_back(i);
  }
  return copies;
}

TEST(FindRepeats, KnowsTheCopiesOfRegularOrders) {
  for (const auto& [pictures, of] : {std::pair(1, 2), {4, 5}, {5, 6}, {2, 3}}) {
    const std::vector<int> shown = Shown(60, pictures, of);
    EXPECT_EQ(FindRepeats(ChangesOf(shown, 3.0, 2.0, 0.0)), CopiesIn(shown)) << pictures << of;
    EXPECT_EQ(FindRepeats(ChangesOf(shown, 1.5, 0.0, 0.4)), CopiesIn(shown)) << pictures << of;
  }
}

TEST(FindRepeats, KnowsSingleCopiesAnywhere) {
  std::vector<int> shown = Shown(60, 1, 1);
  shown[1] = 0;
  shown[23] = shown[22];
  shown[40] = shown[39];
  EXPECT_THAT(FindRepeats(ChangesOf(shown, 3.0, 2.0, 0.3)), ElementsAre(1U, 23U, 40U));
}

// A codec leaves a third of the change in every copy: each alone would not be sure.
TEST(FindRepeats, TheOrderDecidesWhereACodecHasBlurredTheCopies) {
  const std::vector<int> shown = Shown(100, 4, 5);
  std::vector<FrameChange> changes;
  for (std::size_t i = 1; i < shown.size(); ++i) {
    const double pulse = 1.0 + 0.2 * std::sin(0.9 * static_cast<double>(i));
    changes.push_back({(shown[i] == shown[i - 1] ? 1.3 : 4.0) * pulse, 0.55});
  }
  EXPECT_EQ(FindRepeats(changes), CopiesIn(shown));
  changes[20].rms = 1.5;  // a slow moment
  EXPECT_EQ(FindRepeats(changes), CopiesIn(shown));
}

TEST(FindRepeats, SlowAndStillClipsRepeatNothing) {
  EXPECT_THAT(FindRepeats(ChangesOf(Shown(60, 1, 1), 0.1, 0.0, 0.5)), IsEmpty()) << "slow";
  EXPECT_THAT(FindRepeats(ChangesOf(Shown(60, 1, 1), 0.0, 3.0, 0.0)), IsEmpty()) << "noise alone";
  EXPECT_THAT(FindRepeats(ChangesOf(std::vector<int>(60, 0), 0.0, 0.0, 0.0)), IsEmpty()) << "still";
  // A codec that renews a still picture now and then.
  std::vector<FrameChange> changes(60, FrameChange{0.0, 0.0});
  for (std::size_t i = 0; i < changes.size(); i += 4) changes[i] = {2.0 + 0.3 * (i % 3), 0.2};
  EXPECT_THAT(FindRepeats(changes), IsEmpty()) << "renewed";
  // A camera that sways: between two strokes it hardly moves.
  changes.clear();
  for (int i = 0; i < 60; ++i) changes.push_back({0.8 + 9.0 * std::abs(std::sin(0.4 * i)), 0.6});
  EXPECT_THAT(FindRepeats(changes), IsEmpty()) << "sway";
}

// A title card before the scene.
TEST(FindRepeats, AStillBeginningIsNotACopy) {
  std::vector<int> shown(40, 0);
  for (int i = 0; i < 60; ++i) shown.push_back(10 + i);
  EXPECT_THAT(FindRepeats(ChangesOf(shown, 3.0, 2.0, 0.0)), IsEmpty());
}

}  // namespace
}  // namespace cohort
