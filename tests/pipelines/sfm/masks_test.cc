#include "pipelines/sfm/masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "datasets/open_sequence.h"
#include "frontend/storage/output.h"
#include "tests/support/picture_clip.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using std::string_literals::operator""s;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

constexpr int kWidth = 64;
constexpr int kHeight = 48;

// White but for its left half.
cv::Mat LeftHalf(double black = 0.0, double white = 255.0, int type = CV_8UC1) {
  cv::Mat mask(kHeight, kWidth, type, cv::Scalar(white));
  mask.colRange(0, kWidth / 2).setTo(black);
  return mask;
}

// One frame, `covered` of whose columns are black.
void WriteMask(const std::string& file, int covered) {
  std::filesystem::create_directories(std::filesystem::path(file).parent_path());
  cv::Mat mask(kHeight, kWidth, CV_8UC1, cv::Scalar(255));
  mask.colRange(0, covered).setTo(0);
  ASSERT_TRUE(cv::imwrite(file, mask));
}

// A folder of grey pictures of these names.
std::unique_ptr<Sequence> ClipOf(const test::TempDir& dir, const std::vector<std::string>& names) {
  std::filesystem::create_directory(dir / "clip");
  for (const std::string& name : names) {
    cv::imwrite(dir / ("clip/" + name), cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(90)));
  }
  return OpenSequence(dir / "clip");
}

// Black columns of each frame.
std::vector<int> CoveredOf(Sequence& sequence) {
  std::vector<int> covered;
  while (const auto frame = sequence.Next()) {
    covered.push_back(frame->mask.empty() ? 0 : kWidth - cv::countNonZero(frame->mask) / kHeight);
  }
  return covered;
}

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

TEST(ReadMask, OfTwoValuesTheDarkerOneIsBlackAtAnyDepth) {
  const test::TempDir dir;
  for (const int type : {CV_8UC1, CV_16UC1}) {
    cv::Mat values(48, 64, type, cv::Scalar(1));
    values.rowRange(0, 10) = 0;
    cv::imwrite(dir / "mask.png", values);
    const cv::Mat mask = ReadMask(dir / "mask.png");
    EXPECT_EQ(mask.type(), CV_8UC1);
    EXPECT_EQ(cv::countNonZero(mask), 38 * 64) << type;
  }
  cv::Mat point = cv::Mat::zeros(48, 64, CV_8UC1);
  point.at<std::uint8_t>(47, 63) = 1;
  cv::imwrite(dir / "mask.png", point);
  EXPECT_EQ(cv::countNonZero(ReadMask(dir / "mask.png")), 1);
}

TEST(ReadMask, BlackMayBeSixteenAndWhiteLessThanWhite) {
  const test::TempDir dir;
  for (const cv::Mat& mask : {LeftHalf(16.0, 235.0),
                              LeftHalf(16.0, 255.0),
                              LeftHalf(79.0, 179.0),
                              LeftHalf(4096.0, 60000.0, CV_16UC1)}) {
    cv::imwrite(dir / "mask.png", mask);
    EXPECT_EQ(cv::norm(ReadMask(dir / "mask.png"), LeftHalf(), cv::NORM_INF), 0.0);
  }
  // JPEG rounds the edges of what is not aligned with its blocks.
  cv::Mat disc(kHeight, kWidth, CV_8UC1, cv::Scalar(0));
  cv::circle(disc, {30, 25}, 15, cv::Scalar(255), cv::FILLED);
  cv::imwrite(dir / "mask.jpg", disc, {cv::IMWRITE_JPEG_QUALITY, 60});
  EXPECT_LT(cv::countNonZero(ReadMask(dir / "mask.jpg") != disc), 30);
  cv::imwrite(dir / "mask.png", cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(16)));
  EXPECT_EQ(cv::countNonZero(ReadMask(dir / "mask.png")), 0);
}

TEST(ReadMask, WhatIsTransparentIsMasked) {
  const test::TempDir dir;
  cv::Mat white(kHeight, kWidth, CV_8UC4, cv::Scalar::all(255));
  white.colRange(0, kWidth / 2).setTo(cv::Scalar(255, 255, 255, 0));
  cv::imwrite(dir / "mask.png", white);
  EXPECT_EQ(cv::norm(ReadMask(dir / "mask.png"), LeftHalf(), cv::NORM_INF), 0.0);
  // An alpha that is the same everywhere says nothing.
  cv::Mat opaque;
  cv::cvtColor(LeftHalf(), opaque, cv::COLOR_GRAY2BGRA);
  for (const int alpha : {0, 255}) {
    cv::insertChannel(cv::Mat(opaque.size(), CV_8UC1, cv::Scalar(alpha)), opaque, 3);
    cv::imwrite(dir / "mask.png", opaque);
    EXPECT_EQ(cv::norm(ReadMask(dir / "mask.png"), LeftHalf(), cv::NORM_INF), 0.0) << alpha;
  }
}

TEST(ReadMask, APictureOfTheClipIsNoMask) {
  const test::TempDir dir;
  cv::Mat picture(kHeight, kWidth, CV_8UC1);
  cv::randu(picture, 40, 220);
  cv::imwrite(dir / "mask.png", picture);
  EXPECT_THAT([&] { ReadMask(dir / "mask.png"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("mask.png is not a mask"),
                                         HasSubstr("neither black nor white"))));
}

TEST(ClipMasks, OneThatIsBlackAllOverIsRefused) {
  const test::TempDir dir;
  WriteMask(dir / "mask.png", kWidth);
  EXPECT_THAT([&] { ClipMasks(dir / "mask.png"); },
              ThrowsMessage<Error>(HasSubstr("mask.png is entirely black")));
}

TEST(ClipMasks, AreNamedAsColmapAndNerfstudioNameThem) {
  const test::TempDir dir;
  for (const std::string folder :
       {"colmap/a.jpg.png", "stem/a.png", "same/a.jpg", "deep/x/a.png"}) {
    WriteMask(dir / folder, 8);
  }
  WriteBytes(dir / "transforms.json",
             R"({"frames": [{"file_path": "images/a.jpg", "mask_path": "stem/a.png"},
                            {"file_path": "images/b.jpg"}]})");
  for (const std::string masks : {"colmap", "stem", "same", "deep", "transforms.json", ""}) {
    const ClipMasks read((dir / masks).string());
    EXPECT_TRUE(read.AreOnePerFrame());
    EXPECT_THAT(read.FileOf("a.jpg").string(), HasSubstr("/a.")) << masks;
    EXPECT_THAT(read.FileOf("b.jpg").string(), IsEmpty()) << masks;
  }
}

TEST(MaskedSequence, EachFrameHasItsOwnMask) {
  const test::TempDir dir;
  for (int i = 0; i < 3; ++i) WriteMask(dir / fmt::format("masks/{}.png.png", i), 8 * (i + 1));
  MaskedSequence clip(ClipOf(dir, {"0.png", "1.png", "2.png"}), ClipMasks(dir / "masks"));
  for (int round = 0; round < 2; ++round) {
    EXPECT_EQ(CoveredOf(clip), (std::vector<int>{8, 16, 24}));
    EXPECT_EQ(clip.Warning(), "");
    EXPECT_THAT(clip.Coverage(), HasSubstr("cover 25 %"));
    EXPECT_FALSE(clip.CoverTooMuch());
    clip.Rewind();
  }
}

TEST(MaskedSequence, AMaskForAllFramesAndAlphaAddUp) {
  const test::TempDir dir;
  WriteMask(dir / "mask.png", 16);
  cv::Mat bgra(kHeight, kWidth, CV_8UC4, cv::Scalar(90, 90, 90, 255));
  bgra.colRange(kWidth - 8, kWidth).setTo(cv::Scalar(90, 90, 90, 0));
  std::filesystem::create_directory(dir / "clip");
  cv::imwrite(dir / "clip/0.png", bgra);
  MaskedSequence alone(OpenSequence(dir / "clip"), {});
  EXPECT_EQ(CoveredOf(alone), std::vector<int>{8});
  EXPECT_THAT(alone.Coverage(), HasSubstr("alpha covers 12 %"));
  MaskedSequence both(OpenSequence(dir / "clip"), ClipMasks(dir / "mask.png"));
  EXPECT_EQ(CoveredOf(both), std::vector<int>{24});
}

TEST(MaskedSequence, SaysWhatIsWrongWithMasks) {
  const test::TempDir dir;
  const std::vector<std::string> names{"0.png", "1.png", "2.png"};
  const auto read = [&](const std::string& masks) {
    MaskedSequence clip(ClipOf(dir, names), ClipMasks(dir / masks));
    CoveredOf(clip);
    return clip.Warning();
  };
  // Black and white exchanged.
  WriteMask(dir / "inverted.png", kWidth - 4);
  MaskedSequence inverted(ClipOf(dir, names), ClipMasks(dir / "inverted.png"));
  CoveredOf(inverted);
  EXPECT_TRUE(inverted.CoverTooMuch());
  EXPECT_THAT(inverted.Coverage(), HasSubstr("covers 94 % of the pictures"));
  EXPECT_THAT(inverted.Coverage(), HasSubstr("exchange black and white"));
  // Other frames.
  WriteMask(dir / "others/a.png", 8);
  EXPECT_THAT([&] { read("others"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("others are not named after the frames"),
                                         HasSubstr("others/a.png belongs to no frame"),
                                         HasSubstr("such as 0.png.png"))));
  // Counted from 1 beside frames that are counted from 0.
  for (int i = 1; i <= 3; ++i) WriteMask(dir / fmt::format("from1/{}.png", i), 8);
  EXPECT_THAT([&] { read("from1"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("frame 0.png has no mask"),
                                         HasSubstr("3.png belongs to no frame"))));
  // Of some frames alone.
  WriteMask(dir / "some/1.png", 8);
  EXPECT_THAT(read("some"), HasSubstr("no mask of 2 of the 3 frames, such as 0.png"));
  // Nothing is masked, or all.
  WriteMask(dir / "open.png", 0);
  EXPECT_THAT(read("open.png"), HasSubstr("open.png covers nothing"));
  for (const std::string& name : names) WriteMask(dir / ("black/" + name), kWidth);
  EXPECT_THAT([&] { read("black"); }, ThrowsMessage<Error>(HasSubstr("entirely black")));
  // Another size.
  std::filesystem::create_directory(dir / "small");
  cv::imwrite(dir / "small/0.png", cv::Mat(24, 32, CV_8UC1, cv::Scalar(0)));
  EXPECT_THAT([&] { read("small"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("small/0.png is 32x24"), HasSubstr("64x48"))));
  // None, or two for one frame.
  std::filesystem::create_directory(dir / "none");
  EXPECT_THAT([&] { read("none"); }, ThrowsMessage<Error>(HasSubstr("no masks in")));
  WriteMask(dir / "two/0.png", 8);
  WriteMask(dir / "two/0.jpg", 8);
  EXPECT_THAT([&] { read("two"); },
              ThrowsMessage<Error>(HasSubstr("several masks of the frame 0")));
  WriteBytes(dir / "transforms.json", R"({"frames": [{"file_path": "0.png"}]})");
  EXPECT_THAT([&] { read("transforms.json"); },
              ThrowsMessage<Error>(HasSubstr("no frame has a mask_path")));
}

TEST(FingerprintOfMasks, ChangesWithAnyOfThem) {
  const test::TempDir dir;
  WriteMask(dir / "masks/0.png", 8);
  WriteMask(dir / "masks/1.png", 8);
  const std::string before = FingerprintOfMasks(dir / "masks");
  WriteMask(dir / "masks/1.png", 9);
  EXPECT_NE(FingerprintOfMasks(dir / "masks"), before);
  EXPECT_EQ(FingerprintOfMasks(""), "");
}

}  // namespace
}  // namespace cohort
