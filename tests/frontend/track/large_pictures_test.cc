// Pictures of 67 million pixels.

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "frontend/track/tracker.h"

namespace cohort {
namespace {

TEST(LargePictures, OfEightThousandPixelsASideAreFollowedFromRimToRim) {
  constexpr int kSide = 8192;
  constexpr int kStep = 7;  // px a frame
  cv::Mat world(kSide, kSide + 2 * kStep, CV_8UC1);
  cv::RNG random(5);
  random.fill(world, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(world, world, {}, 4.0);
  cv::normalize(world, world, 0, 255, cv::NORM_MINMAX);
  for (const TrackerKind kind : {TrackerKind::kKlt, TrackerKind::kSubspace}) {
    TrackerOptions options;
    options.tracker = kind;
    options.detector.max_features = 300;
    const auto tracker = MakeTracker(options);
    FrameResult first;
    FrameResult last;
    for (int t = 0; t < 3; ++t) {
      Frame frame;
      frame.index = FrameIndex{static_cast<std::uint32_t>(t)};
      frame.gray = world(cv::Rect(t * kStep, 0, kSide, kSide)).clone();
      last = tracker->Track(frame);
      if (t == 0) first = last;
    }
    ASSERT_EQ(first.observations.size(), 300u);
    ASSERT_GE(last.observations.size(), 295u);
    double furthest = 0.0;
    for (const Observation& o : last.observations) {
      if (ToInt(o.feature) >= first.observations.size()) continue;
      const Eigen::Vector2d moved = o.xy - first.observations[ToInt(o.feature)].xy;
      EXPECT_LT((moved - Eigen::Vector2d(-2 * kStep, 0)).norm(), 0.3);
      furthest = std::max(furthest, o.xy.maxCoeff());
    }
    EXPECT_GT(furthest, 8000.0);
  }
}

}  // namespace
}  // namespace cohort
