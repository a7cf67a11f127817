#include "pipelines/sfm/kept_frames.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/frame_clip.h"

namespace cohort {
namespace {

constexpr int kFramesOfClip = 4;

// Counts its frames that are read, all of which share one picture.
class CountedClip final : public test::FrameClip {
 public:
  CountedClip(const cv::Size& size, int* reads) : FrameClip("clip"), reads_(reads) {
    const cv::Mat picture(size, CV_8UC1);
    for (int i = 0; i < kFramesOfClip; ++i) Add(picture).color = picture;
  }
  std::optional<Frame> Next() override {
    auto frame = FrameClip::Next();
    if (frame) ++*reads_;
    return frame;
  }

 private:
  int* reads_;
};

std::vector<std::uint32_t> Read(Sequence& clip, int most) {
  std::vector<std::uint32_t> numbers;
  while (static_cast<int>(numbers.size()) < most) {
    const auto frame = clip.Next();
    if (!frame) break;
    EXPECT_TRUE(frame->color.empty());
    numbers.push_back(ToInt(frame->index));
  }
  return numbers;
}

TEST(KeepFrames, AShortClipIsReadOnce) {
  int reads = 0;
  const auto clip = KeepFrames(std::make_unique<CountedClip>(cv::Size(8, 6), &reads));
  EXPECT_THAT(Read(*clip, 2), testing::ElementsAre(0, 1));
  for (int reading = 0; reading < 3; ++reading) {
    clip->Rewind();
    EXPECT_THAT(Read(*clip, kFramesOfClip + 1), testing::ElementsAre(0, 1, 2, 3));
  }
  EXPECT_EQ(reads, kFramesOfClip);
}

TEST(KeepFrames, OfALongClipNothingStaysInMemory) {
  int reads = 0;
  const auto clip = KeepFrames(std::make_unique<CountedClip>(cv::Size(10'000, 9'000), &reads));
  for (int reading = 0; reading < 3; ++reading) {
    clip->Rewind();
    EXPECT_THAT(Read(*clip, kFramesOfClip + 1), testing::ElementsAre(0, 1, 2, 3));
  }
  EXPECT_EQ(reads, 3 * kFramesOfClip);
}

}  // namespace
}  // namespace cohort
