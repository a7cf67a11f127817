#include "frontend/track/measure/frame_measurement.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/moving_picture.h"

namespace cohort {
namespace {

const Eigen::Vector2d kMotion(2.4, -1.3);

// Feature 3 was not confirmed in the last frame; something stands before the rim of feature 8 and
// before all of feature 12.
class FrameMeasurementTest : public testing::Test {
 protected:
  FrameMeasurementTest() {
    features_[3].confirmed = false;
    const auto cover = [&](int f, const cv::Rect& around) {
      const Eigen::Vector2d xy = truth_.col(f);
      const cv::Point at(static_cast<int>(xy.x()), static_cast<int>(xy.y()));
      for (int y = 0; y < around.height; ++y) {
        for (int x = 0; x < around.width; ++x) {
          picture_.levels[0].at<float>(around.y + at.y + y, around.x + at.x + x) =
              static_cast<float>(test::NoiseAt(9000 + x, y));
        }
      }
    };
    cover(8, {-16, -16, 10, 33});
    cover(12, {-16, -16, 33, 33});
  }

  FrameMeasurement Measure(const Eigen::Matrix2Xd& guide) const {
    return {picture_, features_, patch_, calibration_, guide};
  }
  TrajectoryModel::Estimate PredictedAtTruth(int f) const {
    TrajectoryModel::Estimate predicted;
    predicted.xy = predicted.expected_xy = truth_.col(f);
    predicted.measured_covariance = 0.04 * Eigen::Matrix2d::Identity();
    return predicted;
  }

  Eigen::Matrix2Xd truth_ = test::GridOfTwenty().colwise() + kMotion;
  std::vector<MeasuredFeature> features_ =
      test::FeaturesAt(test::ShiftedNoise({0, 0}), test::GridOfTwenty());
  Pyramid picture_ = SmoothPyramid(test::ShiftedNoise(kMotion), 0.0);
  PatchOptions patch_;
  CovarianceCalibration calibration_;
};

TEST_F(FrameMeasurementTest, ALargePatchFindsWhatThePictureShowsNearTheGuide) {
  const FrameMeasurement frame = Measure(truth_.colwise() + Eigen::Vector2d(0.8, 0.6));
  for (const std::size_t f : {0u, 6u, 16u, 19u}) {
    ASSERT_TRUE(frame.IsObserved(f)) << f;
    EXPECT_LT((frame.measurement(f).xy - truth_.col(static_cast<Eigen::Index>(f))).norm(), 0.05);
    EXPECT_GT(frame.observed()[f].information.trace(), 0.0);
  }
  EXPECT_FALSE(frame.IsObserved(12));
  EXPECT_EQ(frame.observed()[12].information.trace(), 0.0);
}

TEST_F(FrameMeasurementTest, WhatWasNotConfirmedBeginsAtItsPrediction) {
  FrameMeasurement frame = Measure(truth_);
  EXPECT_EQ(frame.verdict(3), Verdict::kNotMeasured);
  frame.MeasureAtPrediction(3, PredictedAtTruth(3), true);
  EXPECT_TRUE(frame.IsObserved(3));
  EXPECT_EQ(frame.measurement(3).window_px, 31);
}

TEST_F(FrameMeasurementTest, ASmallPatchSeesPastWhatCoversTheRim) {
  FrameMeasurement frame = Measure(truth_);
  EXPECT_FALSE(frame.IsObserved(8));
  frame.MeasureAtPrediction(8, PredictedAtTruth(8), true);
  ASSERT_TRUE(frame.IsObserved(8));
  EXPECT_EQ(frame.measurement(8).window_px, 11);
  EXPECT_LT((frame.measurement(8).xy - truth_.col(8)).norm(), 0.1);
  frame.MeasureAtPrediction(12, PredictedAtTruth(12), true);
  EXPECT_FALSE(frame.IsObserved(12));
}

TEST_F(FrameMeasurementTest, WhatTheOthersContradictIsNotObserved) {
  FrameMeasurement frame = Measure(truth_);
  std::vector<TrajectoryModel::Estimate> predicted;
  for (int f = 0; f < 20; ++f) predicted.push_back(PredictedAtTruth(f));
  predicted[0].expected_xy += Eigen::Vector2d(6, 0);
  ASSERT_TRUE(frame.IsObserved(0));
  const std::size_t before = frame.Residuals(predicted).size();
  frame.TestPositions(predicted);
  EXPECT_EQ(frame.verdict(0), Verdict::kNotWhereExpected);
  EXPECT_EQ(frame.observed()[0].information.trace(), 0.0);
  EXPECT_TRUE(frame.IsObserved(6));
  EXPECT_EQ(frame.Residuals(predicted).size(), before - 1);
}

}  // namespace
}  // namespace cohort
