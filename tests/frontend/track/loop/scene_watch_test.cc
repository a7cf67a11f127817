#include "frontend/track/loop/scene_watch.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <vector>

#include "tests/support/hard_clips.h"

namespace cohort {
namespace {

using test::Pictures;
using testing::Each;
using testing::ElementsAre;
using testing::Ne;

constexpr SceneChange kNone = SceneChange::kNone;
constexpr SceneChange kBlank = SceneChange::kBlank;
constexpr SceneChange kCut = SceneChange::kCut;

std::vector<SceneChange> Watch(const Pictures& pictures) {
  SceneWatch watch;
  std::vector<SceneChange> changes;
  for (const cv::Mat& picture : pictures) changes.push_back(watch.Follow(BuildPyramid(picture)));
  return changes;
}

Pictures OneScene() { return test::MovingClip(0.0, 4); }

// Of the same size, elsewhere in the endless texture.
Pictures AnotherScene() { return test::MovingClip(4000.0, 3); }

TEST(SceneWatch, FindsACutAndTheNextOne) {
  const Pictures clip = test::Joined(test::Joined(OneScene(), AnotherScene()), OneScene());
  EXPECT_THAT(
      Watch(clip),
      ElementsAre(kNone, kNone, kNone, kNone, kCut, kNone, kNone, kCut, kNone, kNone, kNone));
}

TEST(SceneWatch, FindsACutIntoAnotherLight) {
  Pictures dim = AnotherScene();
  for (cv::Mat& picture : dim) picture.convertTo(picture, CV_8U, 0.3, 20.0);
  EXPECT_THAT(Watch(test::Joined(OneScene(), dim)),
              ElementsAre(kNone, kNone, kNone, kNone, kCut, kNone, kNone));
}

// One frame late: the first might have been a frame lost.
TEST(SceneWatch, FindsACutIntoNearlyNothing) {
  Pictures faint = AnotherScene();
  for (cv::Mat& picture : faint) picture.convertTo(picture, CV_32F, 0.06 / 255.0, 0.1);
  EXPECT_THAT(Watch(test::Joined(OneScene(), faint)),
              ElementsAre(kNone, kNone, kNone, kNone, kBlank, kCut, kNone));
}

// Pictures of 16 bits show what is less than a step of 8.
TEST(SceneWatch, FindsACutIntoADarknessOfSixteenBits) {
  Pictures clip = test::Joined(OneScene(), AnotherScene());
  for (std::size_t i = 0; i < clip.size(); ++i) {
    clip[i].convertTo(clip[i], CV_16U, i < OneScene().size() ? 257.0 : 2.0);
  }
  EXPECT_THAT(Watch(clip), ElementsAre(kNone, kNone, kNone, kNone, kBlank, kCut, kNone));
}

TEST(SceneWatch, FastMotionIsNoCut) {
  Pictures clip;
  for (int t = 0; t < 6; ++t) {  // from the fourth on by a third of the picture
    const double x = t < 4 ? 2.0 * t : 6.0 + 50.0 * (t - 3);
    clip.push_back(test::ImageOf([&](double px, double py) { return test::NoiseAt(px + x, py); },
                                 test::kHardWidth,
                                 test::kHardHeight,
                                 CV_8U));
  }
  EXPECT_THAT(Watch(clip), Each(kNone));
}

TEST(SceneWatch, LightThatJumpsOrFadesIsNoCut) {
  EXPECT_THAT(Watch(test::ExposedAnew(test::MovingClip(), 4, 0.1)), Each(kNone));
  EXPECT_THAT(Watch(test::ExposedAnew(test::MovingClip(), 4, 2.5)), Each(kNone));
  Pictures fading = test::MovingClip(0.0, 12);
  double gain = 1.0;
  for (cv::Mat& picture : fading) picture.convertTo(picture, CV_8U, gain *= 0.6);
  EXPECT_THAT(Watch(fading), Each(Ne(kCut)));  // the last ones show nothing any more
}

TEST(SceneWatch, BlurIsNoCut) {
  Pictures clip = OneScene();
  cv::GaussianBlur(clip[2], clip[2], cv::Size(0, 0), 4.0);
  EXPECT_THAT(Watch(clip), Each(kNone));
}

TEST(SceneWatch, FramesDroppedRepeatedOrSwappedAreNoCut) {
  const Pictures moving = test::MovingClip(0.0, 14);
  EXPECT_THAT(Watch(test::Reordered(moving, {0, 1, 1, 2, 8, 7, 9, 13})), Each(kNone));
}

TEST(SceneWatch, AFrameThatIsLostIsBlankAndTheSceneGoesOn) {
  for (const double value : {0.0, 0.5, 1.0}) {
    std::vector<SceneChange> expected(9, kNone);
    expected[4] = kBlank;
    EXPECT_EQ(Watch(test::FrameLostClip(value)), expected) << value;
  }
}

TEST(SceneWatch, AnotherSceneBehindBlackIsACut) {
  const Pictures black(2, test::EvenClip(0.0).front());
  const Pictures clip = test::Joined(test::Joined(OneScene(), black), AnotherScene());
  EXPECT_THAT(Watch(clip),
              ElementsAre(kNone, kNone, kNone, kNone, kBlank, kBlank, kCut, kNone, kNone));
}

TEST(SceneWatch, WhereNoiseHidesAllThereIsNoTelling) {
  EXPECT_THAT(Watch(test::NoiseClip(0.1)), Each(kNone));
  EXPECT_THAT(Watch(test::Joined(test::NoiseClip(0.1), OneScene())), Each(kNone));
}

TEST(SceneWatch, PicturesOfAFewPixelsAreNotTold) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(600, 1), cv::Size(30, 40)}) {
    const Pictures clip{test::SpotsImage(size.width, size.height, 0, 0),
                        test::SpotsImage(size.width, size.height, 0, 0),
                        test::SpotsImage(size.width, size.height, 200, 0)};
    EXPECT_THAT(Watch(clip), Each(kNone)) << size;
  }
}

TEST(SceneWatch, IsOfPicturesOfAnySizeAndShape) {
  for (const cv::Size size : {cv::Size(101, 53), cv::Size(1226, 370), cv::Size(480, 640)}) {
    Pictures clip;
    const double scale = static_cast<double>(test::kHardWidth) / size.width;
    for (const double shift : {0.0, 2.0, 4.0, 5000.0, 5002.0}) {
      clip.push_back(test::ImageOf(
          [&](double x, double y) { return test::NoiseAt(scale * x + shift, scale * y); },
          size.width,
          size.height,
          CV_8U));
    }
    EXPECT_THAT(Watch(clip), ElementsAre(kNone, kNone, kNone, kCut, kNone)) << size;
  }
}

}  // namespace
}  // namespace cohort
