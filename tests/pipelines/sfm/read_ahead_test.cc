#include "pipelines/sfm/read_ahead.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/core/utility.hpp>

#include "frontend/core/error.h"
#include "tests/support/plane_clip.h"

namespace cohort {
namespace {

constexpr int kFrames = 5;

class ReadAheadTest : public testing::TestWithParam<int> {
 protected:
  void SetUp() override { cv::setNumThreads(GetParam()); }
  void TearDown() override { cv::setNumThreads(-1); }
};

TEST_P(ReadAheadTest, GivesEveryFrameOnceAndInOrder) {
  test::PlaneClip clip(kFrames);
  ReadAhead frames(clip);
  std::vector<std::uint32_t> indices;
  while (const auto frame = frames.Next()) {
    frames.Begin();
    frames.Begin();  // has begun
    indices.push_back(ToInt(frame->index));
  }
  EXPECT_THAT(indices, testing::ElementsAre(0, 1, 2, 3, 4));
  EXPECT_FALSE(frames.Next());
}

class BrokenClip : public test::PlaneClip {
 public:
  BrokenClip() : PlaneClip(kFrames) {}
  std::optional<Frame> Next() override {
    auto frame = PlaneClip::Next();
    if (frame && frame->index == FrameIndex{1}) ThrowError("frame 1 is damaged");
    return frame;
  }
};

TEST_P(ReadAheadTest, TellsAnErrorWhereItsFrameIsAskedFor) {
  BrokenClip clip;
  ReadAhead frames(clip);
  ASSERT_TRUE(frames.Next());
  frames.Begin();
  EXPECT_THAT([&] { frames.Next(); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("frame 1 is damaged")));
}

INSTANTIATE_TEST_SUITE_P(Threads, ReadAheadTest, testing::Values(1, 2));

}  // namespace
}  // namespace cohort
