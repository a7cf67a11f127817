#include "pipelines/sfm/fingerprint.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "datasets/open_sequence.h"
#include "frontend/storage/output.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// Pictures of their numbers.
void WritePictures(const fs::path& folder, int count) {
  fs::create_directories(folder);
  for (int i = 0; i < count; ++i) {
    cv::imwrite(folder / (std::to_string(i) + ".bmp"), cv::Mat(20, 30, CV_8UC1, cv::Scalar(i)));
  }
}

TEST(FingerprintOfClip, IsOfAllInTheFolderButTheOutputs) {
  const test::TempDir dir;
  WritePictures(dir / "clip", 3);
  const auto fingerprint = [&](const std::string& input) {
    return FingerprintOfClip(*OpenSequence(input), input, dir / "clip/grid");
  };
  const std::string folder = fingerprint(dir / "clip");
  const std::string glob = fingerprint(dir / "clip/*.bmp");
  WritePictures(dir / "clip/grid/cells", 2);
  EXPECT_EQ(fingerprint(dir / "clip"), folder);
  WriteBytes(dir / "clip/groundtruth.txt", "0 0 0 0 0 0 0 1");
  EXPECT_NE(fingerprint(dir / "clip"), folder);
  EXPECT_EQ(fingerprint(dir / "clip/*.bmp"), glob);
  cv::imwrite(dir / "clip/1.bmp", cv::Mat(20, 30, CV_8UC1, cv::Scalar(7)));
  EXPECT_NE(fingerprint(dir / "clip/*.bmp"), glob);
}

TEST(FingerprintOfClip, IsOfThePicturesOfAFolderThatIsALink) {
  const test::TempDir dir;
  WritePictures(dir / "elsewhere", 2);
  fs::create_directory(dir / "clip");
  fs::create_directory_symlink(dir / "elsewhere", dir / "clip/rgb");
  WriteBytes(dir / "clip/rgb.txt", "0 rgb/0.bmp\n1 rgb/1.bmp\n");
  const auto fingerprint = [&] {
    return FingerprintOfClip(*OpenSequence(dir / "clip"), dir / "clip", dir / "grid");
  };
  const std::string first = fingerprint();
  EXPECT_EQ(fingerprint(), first);
  cv::imwrite(dir / "elsewhere/1.bmp", cv::Mat(20, 30, CV_8UC1, cv::Scalar(7)));
  EXPECT_NE(fingerprint(), first);
}

TEST(FingerprintOfBytes, IsOfEveryOne) {
  const test::TempDir dir;
  std::string bytes(1'000'000, 'a');
  WriteBytes(dir / "mask.bmp", bytes);
  const std::string fingerprint = FingerprintOfBytes(dir / "mask.bmp");
  bytes[600'001] = 'b';
  WriteBytes(dir / "mask.bmp", bytes);
  EXPECT_NE(FingerprintOfBytes(dir / "mask.bmp"), fingerprint);
}

TEST(FingerprintsOfOutputs, AreOfTheBytesAndNotOfTheTime) {
  const test::TempDir dir;
  const auto of_clip_in = [](const fs::path& folder) {
    return FingerprintsOfOutputs(folder, {"clip.mp4"}).at("clip.mp4");
  };
  std::string bytes(1'000'000, 'a');
  WriteBytes(dir / "clip.mp4", bytes);
  const std::string fingerprint = of_clip_in(dir.path());
  EXPECT_EQ(fingerprint.size(), 16u);
  fs::last_write_time(dir / "clip.mp4", fs::file_time_type() + std::chrono::hours(5));
  EXPECT_EQ(of_clip_in(dir.path()), fingerprint);
  fs::create_directory(dir / "elsewhere");
  fs::copy(dir / "clip.mp4", dir / "elsewhere");
  EXPECT_EQ(of_clip_in(dir / "elsewhere"), fingerprint);

  bytes.back() = 'b';
  WriteBytes(dir / "clip.mp4", bytes);
  EXPECT_NE(of_clip_in(dir.path()), fingerprint) << "the end";
  // Another clip of the same size: other bytes everywhere, here but in an eighth.
  bytes.assign(1'000'000, 'a');
  for (std::size_t i = 125'000; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i % 251);
  WriteBytes(dir / "clip.mp4", bytes);
  EXPECT_NE(of_clip_in(dir.path()), fingerprint);
}

TEST(FingerprintOfFrames, IsOfThePicturesAndOfNothingElseInTheFolder) {
  const test::TempDir dir;
  WritePictures(dir.path(), 3);
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
