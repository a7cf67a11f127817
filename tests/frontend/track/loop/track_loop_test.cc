#include "frontend/track/tracker.h"

#include <gtest/gtest.h>

#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

Frame FrameOf(std::uint32_t index) {
  Frame frame;
  frame.index = FrameIndex{index};
  frame.gray = test::WavesImage(320, 240, 0.5 * index, 0);
  return frame;
}

TEST(TrackLoop, DetectionTakesTimeInTheFramesInWhichCornersAreSought) {
  TrackerOptions options;
  options.tracker = TrackerKind::kKlt;
  options.detector.max_features = 40;
  options.detector.redetect_below = 0.0;
  const auto once = MakeTracker(options);
  EXPECT_GT(once->Track(FrameOf(0)).detect_ms, 0.0);
  EXPECT_EQ(once->Track(FrameOf(1)).detect_ms, 0.0);

  options.detector.max_features = 100000;  // never enough
  options.detector.redetect_below = 1.0;
  const auto always = MakeTracker(options);
  EXPECT_GT(always->Track(FrameOf(0)).detect_ms, 0.0);
  EXPECT_GT(always->Track(FrameOf(1)).detect_ms, 0.0);
}

}  // namespace
}  // namespace cohort
