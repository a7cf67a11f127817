// The phone's encoder: bit rate, bytes, sizes, and what it says when it cannot.
#include "datasets/degrade/video_encoder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <opencv2/core.hpp>

#include "datasets/readers/video_sequence.h"
#include "frontend/core/error.h"
#include "frontend/core/random_stream.h"
#include "frontend/storage/output.h"
#include "tests/datasets/fixtures.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using test::TempDir;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

cv::Mat NoisePicture(cv::Size size, std::uint64_t frame) {
  RandomStream random = RandomStream(1, "test").Fork(frame);
  cv::Mat picture(size, CV_8UC1);
  for (std::uint8_t& v : cv::Mat_<std::uint8_t>(picture)) {
    v = static_cast<std::uint8_t>(random.Below(64));
  }
  return picture;
}

void EncodeNoise(const fs::path& file, VideoCodec codec) {
  VideoEncoder encoder(file, {160, 120});
  for (std::uint64_t frame = 0; frame < 40; ++frame) encoder.Add(NoisePicture({160, 120}, frame));
  encoder.Finish(codec, 400, 30.0);
}

// Noise would take ten times as much: forty frames get what they may.
TEST(VideoEncoder, KeepsTheBitRateAndGivesTheSameBytesAgain) {
  const TempDir dir;
  for (const VideoCodec codec : {VideoCodec::kH264, VideoCodec::kHevc}) {
    EncodeNoise(dir / "a.mp4", codec);
    EncodeNoise(dir / "b.mp4", codec);
    EXPECT_NEAR(static_cast<double>(fs::file_size(dir / "a.mp4")), 40.0 / 30.0 * 400e3 / 8.0, 20e3);
    EXPECT_EQ(ReadBytes(dir / "a.mp4"), ReadBytes(dir / "b.mp4"));
    EXPECT_FALSE(fs::exists(dir / "a.mp4.raw"));
  }
}

TEST(VideoEncoder, KeepsGreyValuesFramesAndOddSizes) {
  const TempDir dir;
  const cv::Size odd(65, 49);
  for (const VideoCodec codec : {VideoCodec::kH264, VideoCodec::kHevc}) {
    VideoEncoder encoder(dir / "odd.mp4", odd);
    for (const int value : {0, 40, 128, 200, 255}) {
      encoder.Add(cv::Mat(odd, CV_8UC1, cv::Scalar(value)));
    }
    encoder.Finish(codec, 1000, 30.0);
    const auto video = OpenVideo(dir / "odd.mp4", {});
    const std::vector<Frame> frames = test::ReadAll(*video);
    ASSERT_EQ(frames.size(), 5u);
    EXPECT_EQ(frames[0].gray.size(), cv::Size(66, 50));
    std::size_t i = 0;
    for (const double value : {0, 40, 128, 200, 255}) {
      EXPECT_NEAR(cv::mean(frames[i++].gray)[0], value, 2.5) << value;
    }
  }
}

// PATH as long as one lives.
class Path {
 public:
  explicit Path(const fs::path& folder) : old_(std::getenv("PATH")) {
    setenv("PATH", folder.c_str(), 1);
  }
  Path(const Path&) = delete;
  Path& operator=(const Path&) = delete;
  ~Path() { setenv("PATH", old_.c_str(), 1); }

 private:
  std::string old_;
};

TEST(VideoEncoder, SaysHowToGetFfmpegAndWhatItComplainsOf) {
  const TempDir dir;
  const Path path(dir.path());
  EXPECT_THAT(
      [&] {
        VideoEncoder(dir / "a.mp4", {64, 64});
      },
      ThrowsMessage<Error>(AllOf(HasSubstr("a.mp4"), HasSubstr("apt install ffmpeg"))));
  test::WriteText(dir / "ffmpeg",
                  "#!/bin/sh\necho first; echo \"Unknown encoder 'libx265'\"\nexit 1\n");
  fs::permissions(dir / "ffmpeg", fs::perms::owner_all);
  VideoEncoder encoder(dir / "a.mp4", {64, 64});
  encoder.Add(cv::Mat::zeros(64, 64, CV_8UC1));
  EXPECT_THAT([&] { encoder.Finish(VideoCodec::kHevc, 100, 30.0); },
              ThrowsMessage<Error>(AllOf(HasSubstr("hevc (exit code 1): Unknown encoder"),
                                         Not(HasSubstr("first")))));
}

}  // namespace
}  // namespace cohort
