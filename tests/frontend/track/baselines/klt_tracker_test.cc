#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "frontend/core/random_stream.h"
#include "frontend/track/tracker.h"
#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

Frame FrameOf(std::uint32_t index, const cv::Mat& gray) {
  Frame frame;
  frame.index = FrameIndex{index};
  frame.gray = gray;
  return frame;
}

TrackerOptions Klt() {
  TrackerOptions options;
  options.tracker = TrackerKind::kKlt;
  options.detector.max_features = 60;
  return options;
}

TEST(KltTracker, FollowsAShiftedPictureToATenthOfAPixel) {
  const auto tracker = MakeTracker(Klt());
  const FrameResult first = tracker->Track(FrameOf(0, test::WavesImage(320, 240, 0, 0)));
  ASSERT_GT(first.observations.size(), 30u);
  const FrameResult second = tracker->Track(FrameOf(1, test::WavesImage(320, 240, 3.3, -2.6)));
  std::size_t followed = 0;
  for (const Observation& o : second.observations) {
    if (ToInt(o.feature) >= first.observations.size()) continue;  // born in the second frame
    const Eigen::Vector2d expected =
        first.observations[ToInt(o.feature)].xy + Eigen::Vector2d(3.3, -2.6);
    EXPECT_LT((o.xy - expected).norm(), 0.1) << "feature " << ToInt(o.feature);
    ++followed;
  }
  EXPECT_GT(followed, 25u);
}

TEST(KltTracker, FollowsOneDot) {
  const auto dot_at = [](int x, int y) {
    cv::Mat picture = cv::Mat::zeros(120, 160, CV_8U);
    cv::circle(picture, {x, y}, 4, cv::Scalar(255), cv::FILLED, cv::LINE_AA);
    return picture;
  };
  TrackerOptions options = Klt();
  options.detector.max_features = 1;
  const auto tracker = MakeTracker(options);
  const FrameResult first = tracker->Track(FrameOf(0, dot_at(70, 60)));
  ASSERT_EQ(first.observations.size(), 1u);
  const FrameResult second = tracker->Track(FrameOf(1, dot_at(73, 62)));
  ASSERT_EQ(second.observations.size(), 1u);
  EXPECT_EQ(second.observations[0].feature, first.observations[0].feature);
  EXPECT_NEAR(second.observations[0].xy.x() - first.observations[0].xy.x(), 3.0, 0.02);
  EXPECT_NEAR(second.observations[0].xy.y() - first.observations[0].xy.y(), 2.0, 0.02);
}

TEST(KltTracker, AFeatureThatLeavesTheImageEndsWithThatReason) {
  const auto tracker = MakeTracker(Klt());
  tracker->Track(FrameOf(0, test::WavesImage(320, 240, 0, 0)));
  std::size_t left = 0;
  for (int t = 1; t <= 10; ++t) {
    const FrameResult result = tracker->Track(FrameOf(t, test::WavesImage(320, 240, 6 * t, 0)));
    for (const TrackEnd& end : result.ends) {
      EXPECT_EQ(ToInt(end.last_frame), static_cast<std::uint32_t>(t - 1));
      left += end.reason == LossReason::kLeftImage ? 1 : 0;
    }
  }
  EXPECT_GT(left, 3u);
}

TEST(KltTracker, NoFeatureIsBornUnderTheMask) {
  cv::Mat mask(240, 320, CV_8U, cv::Scalar(255));
  mask(cv::Rect(0, 0, 160, 240)) = 0;
  const auto tracker = MakeTracker(Klt());
  Frame frame = FrameOf(0, test::WavesImage(320, 240, 0, 0));
  frame.mask = mask;
  const FrameResult result = tracker->Track(frame);
  ASSERT_FALSE(result.observations.empty());
  for (const Observation& o : result.observations) EXPECT_GE(o.xy.x(), 159.5);
}

// Each frame has a mask of its own.
TEST(KltTracker, AFeatureEndsWhereItEntersTheMask) {
  const auto tracker = MakeTracker(Klt());
  const FrameResult first = tracker->Track(FrameOf(0, test::WavesImage(320, 240, 0, 0)));
  Frame frame = FrameOf(1, test::WavesImage(320, 240, 3.3, -2.6));
  frame.mask = cv::Mat(240, 320, CV_8U, cv::Scalar(255));
  frame.mask(cv::Rect(0, 0, 160, 240)) = 0;
  const FrameResult second = tracker->Track(frame);
  for (const Observation& o : second.observations) EXPECT_GE(o.xy.x(), 159.5);
  const auto masked = std::count_if(second.ends.begin(), second.ends.end(), [](const auto& end) {
    return end.reason == LossReason::kMasked;
  });
  EXPECT_GT(masked, 0);
  const FrameResult third = tracker->Track(FrameOf(2, test::WavesImage(320, 240, 6.6, -5.2)));
  EXPECT_GE(third.observations.size(), second.observations.size());
}

TEST(KltTracker, StartsAgainAfterABlackFrame) {
  const auto tracker = MakeTracker(Klt());
  tracker->Track(FrameOf(0, test::WavesImage(320, 240, 0, 0)));
  tracker->Track(FrameOf(1, cv::Mat::zeros(240, 320, CV_8U)));
  const FrameResult born = tracker->Track(FrameOf(2, test::WavesImage(320, 240, 20, 0)));
  ASSERT_GT(born.observations.size(), 30u);
  const FrameResult moved = tracker->Track(FrameOf(3, test::WavesImage(320, 240, 21, 0)));
  std::size_t followed = 0;
  for (const Observation& o : moved.observations) {
    for (const Observation& before : born.observations) {
      if (before.feature == o.feature) {
        EXPECT_NEAR(o.xy.x() - before.xy.x(), 1.0, 0.1);
        ++followed;
      }
    }
  }
  EXPECT_GT(followed, 25u);
}

TrackerOptions AnchoredKlt() {
  TrackerOptions options = Klt();
  options.tracker = TrackerKind::kAnchoredKlt;
  return options;
}

// Noise of a twentieth of the range, another in every frame.
cv::Mat NoisyWaves(int frame, double dx, double dy) {
  cv::Mat picture = test::WavesImage(320, 240, dx, dy);
  RandomStream random = RandomStream(1, "test/noise").Fork(static_cast<std::uint64_t>(frame));
  for (std::uint8_t& v : cv::Mat_<std::uint8_t>(picture)) {
    v = cv::saturate_cast<std::uint8_t>(v + 13.0 * random.Gaussian());
  }
  return picture;
}

double MeanErrorAfter(const TrackerOptions& options, int frames) {
  const auto tracker = MakeTracker(options);
  const FrameResult first = tracker->Track(FrameOf(0, NoisyWaves(0, 0, 0)));
  FrameResult last;
  for (int t = 1; t <= frames; ++t) {
    last = tracker->Track(FrameOf(t, NoisyWaves(t, 0.4 * t, -0.3 * t)));
  }
  double sum = 0.0;
  int count = 0;
  for (const Observation& o : last.observations) {
    if (ToInt(o.feature) >= first.observations.size()) continue;
    if (o.state != ObservationState::kObserved) continue;
    const Eigen::Vector2d moved(0.4 * frames, -0.3 * frames);
    sum += (o.xy - first.observations[ToInt(o.feature)].xy - moved).norm();
    ++count;
  }
  EXPECT_GT(count, 15);
  return sum / count;
}

TEST(AnchoredKltTracker, ErrorsDoNotAddUpFromFrameToFrame) {
  EXPECT_LT(MeanErrorAfter(AnchoredKlt(), 30), 0.7 * MeanErrorAfter(Klt(), 30));
}

TEST(AnchoredKltTracker, WhatThePictureDoesNotConfirmStaysPredictedAndEndsAfterFiveFrames) {
  const auto tracker = MakeTracker(AnchoredKlt());
  const std::size_t born =
      tracker->Track(FrameOf(0, test::WavesImage(320, 240, 0, 0))).observations.size();
  const cv::Mat other = test::ImageOf(
      [](double x, double y) { return test::NoiseAt(1.7 * x + 600, y + 300); }, 320, 240, CV_8U);
  std::size_t ended = 0;
  for (int t = 1; t <= 6; ++t) {
    const FrameResult result = tracker->Track(FrameOf(t, other));
    std::size_t observed = 0;
    for (const Observation& o : result.observations) {
      if (ToInt(o.feature) < born && o.state == ObservationState::kObserved) ++observed;
    }
    EXPECT_LE(observed, born / 10) << "frame " << t;
    for (const TrackEnd& end : result.ends) {
      if (ToInt(end.feature) >= born || end.reason != LossReason::kContradicted) continue;
      EXPECT_GE(ToInt(end.last_frame), 5u);
      ++ended;
    }
  }
  EXPECT_GT(ended, born / 2);
}

}  // namespace
}  // namespace cohort
