#include "pipelines/sfm/fixed_pattern.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace cohort {
namespace {

constexpr int kSensorWidth = 240;
constexpr int kSensorHeight = 180;
constexpr int kSensorFrames = 48;

cv::Mat GaussianValues(const cv::Size& size, double sigma, int seed) {
  cv::RNG random(seed);
  cv::Mat values(size, CV_32F);
  random.fill(values, cv::RNG::NORMAL, 0.0, sigma);
  return values;
}

cv::Mat Columns(double sigma) {
  return cv::repeat(GaussianValues({kSensorWidth, 1}, sigma, 5), kSensorHeight, 1);
}

// A texture that moves by `px` a frame behind a sensor of this pattern and noise.
cv::Mat PatternFoundIn(double px, double noise, const cv::Mat& pattern, const cv::Mat& fixed = {}) {
  const int path = static_cast<int>(std::ceil(px * kSensorFrames));
  cv::Mat texture = GaussianValues({kSensorWidth + path, kSensorHeight}, 1.0, 7);
  cv::GaussianBlur(texture, texture, cv::Size(0, 0), 1.5);
  cv::normalize(texture, texture, 30.0, 220.0, cv::NORM_MINMAX);
  FixedPattern found;
  for (int i = 0; i < kSensorFrames; ++i) {
    const int left = static_cast<int>(px * i);
    cv::Mat picture = texture.colRange(left, left + kSensorWidth) + pattern +
                      GaussianValues({kSensorWidth, kSensorHeight}, noise, 100 + i);
    picture.convertTo(picture, CV_8U);
    found.Add(picture, i >= kSensorFrames / 2);
  }
  return found.Find(fixed);
}

// The energy of the pattern that is left over that which was there.
double ShareLeft(const cv::Mat& found, const cv::Mat& pattern) {
  return std::pow(cv::norm(pattern, found) / cv::norm(pattern), 2);
}

TEST(FixedPattern, ColumnsOfASensorAreFoundInItsNoise) {
  const cv::Mat columns = Columns(6.0);
  const cv::Mat found = PatternFoundIn(3.0, 20.0, columns);
  ASSERT_FALSE(found.empty());
  EXPECT_LT(ShareLeft(found, columns), 0.2);
}

TEST(FixedPattern, RowsAreFoundToo) {
  const cv::Mat rows = cv::repeat(GaussianValues({1, kSensorHeight}, 6.0, 6), 1, kSensorWidth);
  const cv::Mat found = PatternFoundIn(3.0, 20.0, rows);
  ASSERT_FALSE(found.empty());
  EXPECT_LT(ShareLeft(found, rows), 0.2);
}

TEST(FixedPattern, NoneIsFoundInASceneThatMovesOrStands) {
  const cv::Mat none = cv::Mat::zeros(kSensorHeight, kSensorWidth, CV_32F);
  for (const double px : {3.0, 0.5, 0.05, 0.0}) {
    EXPECT_TRUE(PatternFoundIn(px, 5.0, none).empty()) << px << " px a frame";
  }
}

TEST(FixedPattern, OneThatIsFaintBesideTheNoiseIsLeft) {
  EXPECT_TRUE(PatternFoundIn(3.0, 30.0, Columns(0.5)).empty());
}

TEST(FixedPattern, FixedPartsOfThePictureAreNoPattern) {
  cv::Mat text = cv::Mat::zeros(kSensorHeight, kSensorWidth, CV_32F);
  cv::putText(text, "2024-03-07", {20, 165}, cv::FONT_HERSHEY_SIMPLEX, 0.7, 200, 2);
  cv::Mat fixed;
  cv::dilate(text > 0, fixed, {}, {-1, -1}, 4);
  EXPECT_TRUE(PatternFoundIn(3.0, 5.0, text, fixed).empty());
  cv::Mat bars = cv::Mat::zeros(kSensorHeight, kSensorWidth, CV_32F);
  bars.rowRange(0, 40).setTo(-255.0F);
  EXPECT_TRUE(PatternFoundIn(3.0, 2.0, bars, bars < 0).empty());
}

TEST(SubtractPattern, TakesLevelsOffPicturesOfAnyDepth) {
  const cv::Mat pattern(2, 2, CV_32F, cv::Scalar(10.0));
  cv::Mat bytes(2, 2, CV_8U, cv::Scalar(4));
  SubtractPattern(pattern, bytes);
  EXPECT_EQ(bytes.at<std::uint8_t>(0, 0), 0) << "no pixel is darker than black";
  cv::Mat words(2, 2, CV_16U, cv::Scalar(10'000));
  SubtractPattern(pattern, words);
  EXPECT_EQ(words.at<std::uint16_t>(0, 0), 10'000 - 10 * 257);
}

}  // namespace
}  // namespace cohort
