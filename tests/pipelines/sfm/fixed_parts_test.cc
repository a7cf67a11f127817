#include "pipelines/sfm/fixed_parts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "pipelines/sfm/masks.h"
#include "tests/support/frame_clip.h"

namespace cohort {
namespace {

constexpr int kTextureWidth = 240;
constexpr int kTextureHeight = 180;
constexpr int kTextureFrames = 48;

// A texture that passes behind the picture by 3 px right and 2 px down a frame.
class Scene {
 public:
  explicit Scene(double noise_levels) : noise_levels_(noise_levels) {
    cv::RNG random(7);
    texture_.create(
        kTextureHeight + 2 * kTextureFrames, kTextureWidth + 3 * kTextureFrames, CV_32F);
    random.fill(texture_, cv::RNG::NORMAL, 0.0, 1.0);
    cv::GaussianBlur(texture_, texture_, cv::Size(0, 0), 2.5);
    cv::normalize(texture_, texture_, 30.0, 220.0, cv::NORM_MINMAX);
  }

  cv::Mat At(int frame) {
    cv::Mat noise(kTextureHeight, kTextureWidth, CV_32F);
    noise_.fill(noise, cv::RNG::NORMAL, 0.0, noise_levels_);
    cv::Mat picture =
        texture_(cv::Rect(3 * frame, 2 * frame, kTextureWidth, kTextureHeight)) + noise;
    picture.convertTo(picture, CV_8U);
    return picture;
  }

 private:
  double noise_levels_;
  cv::RNG noise_{11};
  cv::Mat texture_;
};

void WriteText(cv::Mat& picture) {
  cv::putText(picture, "2024-03-07", {20, 165}, cv::FONT_HERSHEY_SIMPLEX, 0.7, 255, 2);
}

void PaintBars(cv::Mat& picture) {
  picture.rowRange(0, 30).setTo(0);
  picture.rowRange(kTextureHeight - 30, kTextureHeight).setTo(0);
}

// What FixedParts finds in a clip of the scene with an overlay.
template <typename Overlay>
cv::Mat FoundWith(const Overlay& overlay, double noise_levels = 0.0, int still_frames = 0) {
  Scene scene(noise_levels);
  FixedParts parts;
  for (int frame = -still_frames; frame < kTextureFrames; frame += 2) {
    cv::Mat pair[] = {scene.At(std::max(frame, 0)), scene.At(std::max(frame + (frame >= 0), 0))};
    for (cv::Mat& picture : pair) overlay(picture);
    parts.Add(pair[0], pair[1]);
  }
  return parts.Find();
}

class ClipWithText : public test::FrameClip {
 public:
  ClipWithText() : FrameClip("text") {
    Scene scene(0.0);
    for (int i = 0; i < kTextureFrames; ++i) WriteText(Add(scene.At(i)).gray);
  }
};

double ShareOf(const cv::Mat& mask) {
  return mask.empty() ? 0.0 : cv::countNonZero(mask) / static_cast<double>(mask.total());
}

// Of what the overlay paints, the share that is found.
template <typename Overlay>
double ShareFound(const Overlay& overlay, const cv::Mat& found) {
  cv::Mat painted(kTextureHeight, kTextureWidth, CV_8U, cv::Scalar(128));
  overlay(painted);
  painted = painted != 128;
  return found.empty() ? 0.0 : ShareOf(painted & found) / ShareOf(painted);
}

TEST(FixedParts, NoneAreFoundInAPictureThatMovesAsAWhole) {
  for (const double noise_levels : {0.0, 40.0}) {
    EXPECT_TRUE(FoundWith([](cv::Mat&) {}, noise_levels).empty()) << noise_levels;
  }
}

TEST(FixedParts, BurntInTextIsFoundAlsoInNoise) {
  for (const double noise_levels : {0.0, 40.0}) {
    const cv::Mat found = FoundWith(WriteText, noise_levels);
    EXPECT_GT(ShareFound(WriteText, found), 0.95) << noise_levels;
    EXPECT_LT(ShareOf(found), 0.12) << noise_levels;  // the text itself has 0.04
  }
}

TEST(FixedParts, BarsAreFoundUpToTheirEdges) {
  for (const double noise_levels : {0.0, 20.0}) {
    const cv::Mat found = FoundWith(PaintBars, noise_levels);
    EXPECT_EQ(ShareFound(PaintBars, found), 1.0) << noise_levels;
    EXPECT_LT(ShareOf(found), 0.45) << noise_levels;  // the bars have 0.33
  }
}

TEST(FixedParts, ADarkSkyWhoseOutlineMovesIsNotFixed) {
  Scene scene(0.0);
  FixedParts parts;
  for (int frame = 0; frame < kTextureFrames; frame += 2) {
    cv::Mat pair[] = {scene.At(frame), scene.At(frame + 1)};
    for (int i : {0, 1}) pair[i].rowRange(0, 40 + (frame + i) % 24).setTo(0);
    parts.Add(pair[0], pair[1]);
  }
  EXPECT_TRUE(parts.Find().empty());
}

TEST(FixedParts, NothingIsFixedWhereNothingMoves) {
  FixedParts parts;
  for (int i = 0; i < kTextureFrames; ++i) {
    Scene scene(i % 2 == 0 ? 10.0 : 12.0);
    cv::Mat picture = scene.At(0);
    WriteText(picture);
    parts.Add(picture, picture);
  }
  EXPECT_TRUE(parts.Find().empty());
}

TEST(FixedParts, AStillStretchCountsOnce) {
  const cv::Mat found = FoundWith(WriteText, 0.0, 2 * kTextureFrames);
  EXPECT_GT(ShareFound(WriteText, found), 0.95);
  EXPECT_LT(ShareOf(found), 0.12);
}

TEST(PaintOver, RepeatsTheNearestPixelThatIsNotFixed) {
  cv::Mat fixed = cv::Mat::zeros(3, 8, CV_8U);
  fixed.colRange(5, 8).setTo(255);
  cv::Mat gray(3, 8, CV_16U);
  for (int x = 0; x < 8; ++x) gray.col(x).setTo(1000 * x);
  PaintOver(fixed).Apply(gray);
  EXPECT_EQ(gray.at<std::uint16_t>(1, 4), 4000);
  for (int x = 5; x < 8; ++x) EXPECT_EQ(gray.at<std::uint16_t>(1, x), 4000);
}

TEST(MaskedSequence, MasksFixedPartsAndPaintsThemOver) {
  MaskedSequence sequence(std::make_unique<ClipWithText>(), {}, true, FixedPartsMask::kFind);
  const auto frame = sequence.Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->index, FrameIndex{0}) << "the first frame comes first after the search";
  EXPECT_EQ(ShareFound(WriteText, frame->mask == 0), 1.0);
  cv::Mat as_decoded = Scene(0.0).At(0);
  WriteText(as_decoded);
  EXPECT_EQ(cv::norm(frame->color, as_decoded, cv::NORM_INF), 0.0);
  EXPECT_GT(cv::norm(frame->gray, as_decoded, cv::NORM_INF), 20.0) << "the text is painted over";
  EXPECT_THAT(sequence.FixedPartsFound(), testing::HasSubstr("of the picture area stays fixed"));
  sequence.Rewind();
  EXPECT_FALSE(sequence.Next()->mask.empty()) << "a second reading has the same masks";
}

}  // namespace
}  // namespace cohort
