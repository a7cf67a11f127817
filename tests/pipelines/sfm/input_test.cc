#include "pipelines/sfm/input.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "frontend/storage/output.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using std::string_literals::operator""s;

// Frames are read as they are stored, so that a mask must not be turned either.
TEST(ReadMask, IsAsStoredWhateverExifSays) {
  const test::TempDir dir;
  cv::Mat left = cv::Mat::zeros(48, 64, CV_8UC1);
  left.colRange(0, 32) = 255;
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", left, jpeg);
  std::string bytes(jpeg.begin(), jpeg.end());
  // Orientation (tag 112) 6: to be turned by a quarter.
  bytes.insert(2,
               "\xFF\xE1\0\x22"s
               "Exif\0\0MM\0*\0\0\0\x08\0\x01"s
               "\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0"s);
  WriteBytes(dir / "mask.jpg", bytes);
  ASSERT_EQ(cv::imread(dir / "mask.jpg").size(), cv::Size(48, 64)) << "no orientation";
  const cv::Mat mask = ReadMask(dir / "mask.jpg");
  ASSERT_EQ(mask.size(), left.size());
  EXPECT_EQ(mask.type(), CV_8UC1);
  EXPECT_EQ(cv::norm(mask, left, cv::NORM_INF), 0.0);
}

TEST(ReadMask, EveryValueButZeroIsOpenAtAnyDepth) {
  const test::TempDir dir;
  for (const int type : {CV_8UC1, CV_16UC1}) {
    cv::Mat values(48, 64, type, cv::Scalar(1));
    values.rowRange(0, 10) = 0;
    cv::imwrite(dir / "mask.png", values);
    const cv::Mat mask = ReadMask(dir / "mask.png");
    EXPECT_EQ(mask.type(), CV_8UC1);
    EXPECT_EQ(cv::countNonZero(mask), 38 * 64) << type;
  }
}

TEST(ReadMask, RefusesOneThatIsBlackAllOver) {
  const test::TempDir dir;
  cv::Mat mask = cv::Mat::zeros(48, 64, CV_8UC1);
  cv::imwrite(dir / "mask.png", mask);
  try {
    ReadMask(dir / "mask.png");
    FAIL() << "it was taken";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("mask.png is entirely black"));
  }
  mask.at<std::uint8_t>(47, 63) = 1;
  cv::imwrite(dir / "mask.png", mask);
  EXPECT_EQ(cv::countNonZero(ReadMask(dir / "mask.png")), 1);
}

}  // namespace
}  // namespace cohort
