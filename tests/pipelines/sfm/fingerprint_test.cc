#include "pipelines/sfm/fingerprint.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "datasets/open_sequence.h"
#include "frontend/core/output.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

TEST(FingerprintOfClip, IsOfTheBytesAndNotOfTheTime) {
  const test::TempDir dir;
  std::string bytes(1'000'000, 'a');
  WriteBytes(dir / "clip.mp4", bytes);
  const std::string fingerprint = FingerprintOfClip(dir / "clip.mp4");
  EXPECT_EQ(fingerprint.size(), 16u);
  fs::last_write_time(dir / "clip.mp4", fs::file_time_type() + std::chrono::hours(5));
  EXPECT_EQ(FingerprintOfClip(dir / "clip.mp4"), fingerprint);
  fs::create_directory(dir / "elsewhere");
  fs::copy(dir / "clip.mp4", dir / "elsewhere");
  EXPECT_EQ(FingerprintOfClip(dir / "elsewhere/clip.mp4"), fingerprint);

  bytes.back() = 'b';
  WriteBytes(dir / "clip.mp4", bytes);
  EXPECT_NE(FingerprintOfClip(dir / "clip.mp4"), fingerprint) << "the end";
  // Another clip of the same size: other bytes everywhere, here but in an eighth.
  bytes.assign(1'000'000, 'a');
  for (std::size_t i = 125'000; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i % 251);
  WriteBytes(dir / "clip.mp4", bytes);
  EXPECT_NE(FingerprintOfClip(dir / "clip.mp4"), fingerprint);
}

TEST(FingerprintOfFrames, IsOfThePicturesAndOfNothingElseInTheFolder) {
  const test::TempDir dir;
  for (int i = 0; i < 3; ++i) {
    cv::imwrite(dir / (std::to_string(i) + ".bmp"), cv::Mat(20, 30, CV_8UC1, cv::Scalar(i)));
  }
  const auto fingerprint = [&](const FrameRange& range = {}) {
    return FingerprintOfFrames(*OpenSequence(dir.path(), Layout::kAuto, range));
  };
  const std::string first = fingerprint();
  WriteBytes(dir / "notes.txt", "such as a scene that is written there");
  fs::create_directory(dir / "scene");
  cv::imwrite(dir / "scene/1.bmp", cv::Mat(20, 30, CV_8UC1, cv::Scalar(9)));
  EXPECT_EQ(fingerprint(), first);
  EXPECT_EQ(fingerprint({.first = 1, .end = 2}), first) << "one clip, whatever frames are taken";
  cv::imwrite(dir / "1.bmp", cv::Mat(20, 30, CV_8UC1, cv::Scalar(7)));
  EXPECT_NE(fingerprint(), first);
}

}  // namespace
}  // namespace cohort
