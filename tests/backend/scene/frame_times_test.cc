#include "backend/scene/frame_times.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace cohort {
namespace {

using ::testing::IsEmpty;

constexpr double kNsPerFrame = 1e9 / 30.0;

// Tracks of a camera whose picture moves by `steps[i]` px from the i-th picture to the next. The
// frames have these indices, and every index in between is a repeat. Time stamps are those of 30
// frames a second.
TrackFile Moving(const std::vector<std::uint32_t>& indices, const std::vector<double>& steps) {
  TrackFile file;
  file.width_px = 640;
  file.height_px = 480;
  std::vector<Observation> observations;
  double x = 0.0;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const auto ns = [](std::uint32_t index) { return std::llround(kNsPerFrame * index); };
    if (i > 0) {
      x += steps[i - 1];
      for (std::uint32_t copy = indices[i - 1] + 1; copy < indices[i]; ++copy) {
        file.repeats.push_back({{FrameIndex{copy}, "", ns(copy)}, FrameIndex{indices[i - 1]}});
      }
    }
    file.frames.push_back({FrameIndex{indices[i]}, "", ns(indices[i])});
    for (std::uint32_t f = 0; f < 20; ++f) {
      Observation o{FeatureId{f}, FrameIndex{indices[i]}};
      o.xy = {x + f, 10.0 * f};
      observations.push_back(o);
    }
  }
  file.tracks = TrackSet::Build(std::move(observations));
  return file;
}

TEST(CaptureTimes, EvenStampsNeedNone) {
  EXPECT_THAT(CaptureTimes(Moving({0, 1, 2, 3, 4}, {2, 2, 2, 2})), IsEmpty());
  TrackFile without = Moving({0, 1, 2, 3, 4}, {2, 2, 2, 2});
  for (FrameInfo& frame : without.frames) frame.timestamp_ns = 0;
  EXPECT_THAT(CaptureTimes(without), IsEmpty()) << "no stamps";
}

TEST(CaptureTimes, FollowStampsOfAVariableRate) {
  TrackFile file = Moving({0, 1, 2, 3, 4, 5}, {2, 2, 2, 2, 2});
  for (std::size_t i = 3; i < file.frames.size(); ++i) {
    file.frames[i].timestamp_ns += std::llround(kNsPerFrame);  // one frame was dropped
  }
  const FrameTimes times = CaptureTimes(file);
  ASSERT_EQ(times.size(), 6U);
  EXPECT_NEAR(TimeOf(times, FrameIndex{3}) - TimeOf(times, FrameIndex{2}), 2.0, 1e-6);
  EXPECT_NEAR(TimeOf(times, FrameIndex{4}) - TimeOf(times, FrameIndex{3}), 1.0, 1e-6);
}

TEST(CaptureTimes, AStampThatDoesNotAscendCountsAsOneInterval) {
  TrackFile file = Moving({0, 1, 2, 3, 4, 5, 6, 7}, {2, 2, 2, 2, 2, 2, 2});
  file.frames[3].timestamp_ns = file.frames[2].timestamp_ns;
  const FrameTimes times = CaptureTimes(file);
  for (std::uint32_t i = 1; i < 8; ++i) {
    EXPECT_GT(TimeOf(times, FrameIndex{i}), TimeOf(times, FrameIndex{i - 1}));
  }
}

// 24 pictures a second stored at 30: the camera moved equally far from each to the next.
TEST(CaptureTimes, PicturesStoredAtAHigherRateAreEven) {
  const TrackFile file = Moving({0, 1, 3, 4, 5, 6, 8, 9, 10, 11, 13}, std::vector<double>(10, 3.0));
  const FrameTimes times = CaptureTimes(file);
  ASSERT_EQ(times.size(), 11U);
  EXPECT_NEAR(TimeOf(times, FrameIndex{3}) - TimeOf(times, FrameIndex{1}), 1.0, 1e-9);
  EXPECT_NEAR(TimeOf(times, FrameIndex{13}) - TimeOf(times, FrameIndex{0}), 10.0, 1e-9);
}

TEST(CaptureTimes, OfDoubledFramesAreCountedInPictures) {
  const FrameTimes times = CaptureTimes(Moving({0, 2, 4, 6, 8}, {3, 3, 3, 3}));
  ASSERT_EQ(times.size(), 5U);
  EXPECT_NEAR(TimeOf(times, FrameIndex{8}) - TimeOf(times, FrameIndex{0}), 4.0, 1e-9);
}

// Copies in place of pictures that were missed: the camera moved twice as far.
TEST(CaptureTimes, CopiesInPlaceOfMissedPicturesLeaveTheStamps) {
  const TrackFile file = Moving({0, 1, 3, 4, 5, 6, 8, 9, 10}, {3, 6, 3, 3, 3, 6, 3, 3});
  const FrameTimes times = CaptureTimes(file);
  EXPECT_NEAR(TimeOf(times, FrameIndex{3}) - TimeOf(times, FrameIndex{1}), 2.0, 1e-6);
  EXPECT_NEAR(TimeOf(times, FrameIndex{10}) - TimeOf(times, FrameIndex{0}), 10.0, 1e-6);
}

}  // namespace
}  // namespace cohort
