#include "frontend/detect/corners.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

constexpr int kWidth = 320;
constexpr int kHeight = 240;
constexpr int kBorderPx = 16;

std::vector<Eigen::Vector2d> Detect(const cv::Mat& gray, const DetectorOptions& options = {}) {
  return DetectCorners(gray, {}, {}, kBorderPx, options.max_features, options);
}

cv::Mat NoisePicture(double sigma, double blur_px = 0.0, std::uint64_t seed = 3) {
  RandomStream random(seed, "test/corners/noise");
  cv::Mat noise = test::ImageOf(
      [&](double, double) { return 0.3 + sigma * random.Gaussian(); }, kWidth, kHeight, CV_32F);
  if (blur_px > 0.0) cv::GaussianBlur(noise, noise, cv::Size(0, 0), blur_px);
  return noise;
}

cv::Mat TexturePicture() { return test::ImageOf(test::NoiseAt, kWidth, kHeight, CV_32F); }

// Blurred dark squares on bright ground: their corners are known.
constexpr int kSquarePx = 30;
cv::Mat Squares() {
  cv::Mat picture(kHeight, kWidth, CV_32FC1, cv::Scalar::all(0.8));
  for (int y = 40; y + kSquarePx < kHeight - 30; y += 70) {
    for (int x = 40; x + kSquarePx < kWidth - 30; x += 70) {
      picture(cv::Rect(x, y, kSquarePx, kSquarePx)).setTo(0.2);
    }
  }
  cv::GaussianBlur(picture, picture, cv::Size(0, 0), 1.0);
  return picture;
}

TEST(Corners, AreFoundAtTheCornersOfSquares) {
  const auto corners = Detect(Squares());
  ASSERT_EQ(corners.size(), 4u * 4u * 2u);
  for (const auto& xy : corners) {
    // Edges lie between pixels: 39.5, 69.5, 109.5 ...; a blurred corner is seen a little inside.
    const auto from_edge = [](double v) {
      const double phase = std::fmod(v - 39.5 + 7.0, 70.0) - 7.0;
      return std::min(std::abs(phase), std::abs(phase - kSquarePx));
    };
    EXPECT_LT(from_edge(xy.x()), 3.0) << xy.transpose();
    EXPECT_LT(from_edge(xy.y()), 3.0) << xy.transpose();
  }
}

// By night the rest of the picture has a hundredth of a lamp's contrast.
TEST(Corners, ALampTakesNoneFromTheRestOfADarkPicture) {
  const cv::Mat dark = 0.02 + 0.05 * (TexturePicture() - 0.5);
  cv::Mat with_lamp = dark.clone();
  with_lamp(cv::Rect(150, 110, 12, 12)).setTo(0.98);
  const std::size_t without = Detect(dark).size();
  EXPECT_GT(without, 100u);
  EXPECT_GT(Detect(with_lamp).size(), 0.7 * static_cast<double>(without));
}

// What stands on a blank ground is the picture.
TEST(Corners, ABlankGroundHasNoSay) {
  cv::Mat picture(kHeight, kWidth, CV_32FC1, cv::Scalar::all(0.0));
  Squares()(cv::Rect(30, 30, 50, 50)).copyTo(picture(cv::Rect(30, 30, 50, 50)));
  const cv::Mat faint = 0.002 * TexturePicture()(cv::Rect(0, 0, 60, 60));
  faint.copyTo(picture(cv::Rect(200, 120, 60, 60)));
  for (const auto& xy : Detect(picture)) {
    EXPECT_LT(xy.x(), 120.0) << "a corner of what is fainter by a thousand: " << xy.transpose();
  }
}

TEST(Corners, DetectionLeavesThePictureAsItIs) {
  const cv::Mat picture = TexturePicture();
  const cv::Mat before = picture.clone();
  Detect(picture);
  EXPECT_EQ(cv::norm(picture, before, cv::NORM_INF), 0.0);
}

TEST(Corners, AreNotSeenInNoise) {
  // The strongest of thousands of maxima of noise reach five times its median now and then.
  EXPECT_LE(Detect(NoisePicture(0.02)).size(), 8u) << "white noise";
  const cv::Mat twice = NoisePicture(0.02, 0.8) + NoisePicture(0.02, 0.0, 4) - 0.3;
  EXPECT_LE(Detect(twice).size(), 8u) << "noise, blur, noise";
  DetectorOptions options;
  options.min_over_noise = 0.0;
  EXPECT_GE(Detect(NoisePicture(0.02), options).size(), 250u) << "the picture can show none";
}

TEST(Corners, AreSeenInTextureWithoutFlatAreas) {
  EXPECT_GE(Detect(TexturePicture()).size(), 100u);
}

TEST(Corners, InNoiseOnlyTextureHasThem) {
  cv::Mat picture = NoisePicture(0.02);
  const cv::Rect left(0, 0, kWidth / 2, kHeight);
  picture(left) = picture(left) + 0.5 * TexturePicture()(left);
  const auto corners = Detect(picture);
  EXPECT_GE(corners.size(), 25u);
  int outside = 0;
  for (const auto& xy : corners) outside += xy.x() > left.width + 6 ? 1 : 0;
  EXPECT_LE(outside, 4);
}

TEST(Corners, KeepTheirDistanceFromEachOtherOthersMaskAndBorder) {
  const DetectorOptions options;
  cv::Mat mask(kHeight, kWidth, CV_8UC1, cv::Scalar::all(255));
  mask(cv::Rect(200, 0, 120, kHeight)).setTo(0);
  const std::vector<Eigen::Vector2d> occupied{{60, 60}, {90, 120}};
  const auto corners = DetectCorners(TexturePicture(), occupied, mask, kBorderPx, 400, options);
  ASSERT_GE(corners.size(), 50u);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    EXPECT_GE(corners[i].x(), kBorderPx - 0.5);
    EXPECT_GE(corners[i].y(), kBorderPx - 0.5);
    EXPECT_LE(corners[i].x(), 199.5);
    EXPECT_LE(corners[i].y(), kHeight - 0.5 - kBorderPx);
    for (const auto& other : occupied) {
      EXPECT_GE((corners[i] - other).norm(), options.min_distance_px);
    }
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_GE((corners[i] - corners[j]).norm(), options.min_distance_px);
    }
  }
}

TEST(Corners, AMaskOverBlackBarsKeepsTheNoiseKnown) {
  cv::Mat picture = NoisePicture(0.02);
  cv::Mat mask(kHeight, kWidth, CV_8UC1, cv::Scalar::all(255));
  for (const cv::Rect& bar :
       {cv::Rect(0, 0, kWidth, kHeight / 3), cv::Rect(0, 2 * kHeight / 3, kWidth, kHeight / 3)}) {
    picture(bar).setTo(0.0);
    const cv::Rect masked(0, std::max(bar.y - 10, 0), kWidth, bar.height + 10);
    mask(masked).setTo(0);
  }
  const DetectorOptions options;
  EXPECT_LE(DetectCorners(picture, {}, mask, kBorderPx, 400, options).size(), 4u);
}

TEST(Corners, AreSpreadOverTheGrid) {
  DetectorOptions options;
  options.max_features = 48;
  std::vector<int> in_cell(48, 0);
  for (const auto& xy : Detect(TexturePicture(), options)) {
    ++in_cell[static_cast<std::size_t>(xy.y() * 6 / kHeight) * 8 +
              static_cast<std::size_t>(xy.x() * 8 / kWidth)];
  }
  int used = 0;
  for (const int n : in_cell) used += n > 0 ? 1 : 0;
  EXPECT_GE(used, 40);
}

}  // namespace
}  // namespace cohort
