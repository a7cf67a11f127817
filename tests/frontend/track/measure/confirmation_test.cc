#include "frontend/track/measure/confirmation.h"

#include <gtest/gtest.h>

#include "frontend/track/subspace/predicted_or_ended.h"
#include "tests/frontend/track/moving_picture.h"

namespace cohort {
namespace {

constexpr std::size_t kTested = 7;

// Twenty features of a picture that did not move, measured where they are; some change to one of
// them fails one test.
class ConfirmationTest : public testing::Test {
 protected:
  Eigen::Vector2d Truth() const { return x_.col(kTested); }
  MeasuredFeature& feature() { return features_[kTested]; }

  // Something flat stands before the feature.
  void Hide(int half_px) {
    for (cv::Mat& level : picture_.levels) level = level.clone();
    const cv::Point at(static_cast<int>(Truth().x()), static_cast<int>(Truth().y()));
    picture_.levels[0](cv::Rect(at.x - half_px, at.y - half_px, 2 * half_px + 1, 2 * half_px + 1)) =
        0.05F;
  }

  Measurement Measured(const Eigen::Vector2d& xy) const {
    Measurement m;
    m.converged = true;
    m.xy = xy;
    m.window_px = 31;
    m.correlation = 1.0;
    m.shape = 1e-3 * Eigen::Matrix2d::Identity();
    Eigen::Index nearest = 0;
    (x_.colwise() - xy).colwise().norm().minCoeff(&nearest);
    m.center = CompareCenter(picture_, features_[static_cast<std::size_t>(nearest)].anchor, xy);
    return m;
  }

  // The others say so, to half a pixel.
  static TrajectoryModel::Estimate Predicted(const Eigen::Vector2d& xy, double sigma_px = 0.5) {
    TrajectoryModel::Estimate predicted;
    predicted.xy = predicted.expected_xy = xy;
    predicted.measured_covariance = sigma_px * sigma_px * Eigen::Matrix2d::Identity();
    return predicted;
  }

  Confirmation Tests() const {
    std::vector<Measurement> measured;
    for (const Eigen::Vector2d xy : x_.colwise()) measured.push_back(Measured(xy));
    return {picture_, patch_, calibration_, features_, measured};
  }

  Eigen::Matrix2Xd x_ = test::GridOfTwenty();
  Pyramid picture_ = SmoothPyramid(test::ShiftedNoise({0, 0}), 0.0);
  std::vector<MeasuredFeature> features_ = test::FeaturesAt(test::ShiftedNoise({0, 0}), x_);
  PatchOptions patch_;
  CovarianceCalibration calibration_;
};

TEST_F(ConfirmationTest, WhatLooksLikeTheAnchorNearTheGuideIsObserved) {
  EXPECT_EQ(Tests().TestPatch(feature(), Measured(Truth()), Truth() + Eigen::Vector2d(3, 0)),
            Verdict::kObserved);
}

TEST_F(ConfirmationTest, WhatEndsFarFromTheGuideIsNot) {
  EXPECT_EQ(Tests().TestPatch(feature(), Measured(Truth()), Truth() + Eigen::Vector2d(6, 0)),
            Verdict::kTooFarFromStart);
}

TEST_F(ConfirmationTest, WhatDidNotConvergeWasNotMeasured) {
  Measurement m;
  m.xy = Truth();
  EXPECT_EQ(Tests().TestPatch(feature(), m, Truth()), Verdict::kNotMeasured);
}

TEST_F(ConfirmationTest, WhatCorrelatesTooLittleOrDiffersByMoreThanNoiseIsNotTheAnchor) {
  Measurement m = Measured(Truth());
  m.correlation = 0.29;
  EXPECT_EQ(Tests().TestPatch(feature(), m, Truth()), Verdict::kUnlikeTheAnchor);
  m = Measured(Truth());
  m.residual_variance = feature().anchor.signal_variance;
  EXPECT_EQ(Tests().TestPatch(feature(), m, Truth()), Verdict::kUnlikeTheAnchor);
}

TEST_F(ConfirmationTest, SomethingBeforeTheInnermostPixelsHidesTheFeature) {
  Hide(4);
  const Confirmation tests = Tests();
  EXPECT_EQ(tests.TestPatch(feature(), Measured(Truth()), Truth()), Verdict::kCenterDiffers);
  EXPECT_EQ(
      tests.TestSmallPatchAtPrediction(feature(), Measured(Truth()), Predicted(Truth()), true),
      Verdict::kCenterDiffers);
  EXPECT_TRUE(tests.IsHidden(feature(), Predicted(Truth())));
  EXPECT_FALSE(tests.IsHidden(features_[kTested + 3], Predicted(x_.col(kTested + 3))));
}

TEST_F(ConfirmationTest, WhatTellsTooLittleIsNotBelieved) {
  Measurement m = Measured(Truth());
  m.shape = 16.0 / (0.5 * calibration_.scale()) * Eigen::Matrix2d::Identity();  // 4 px each way
  EXPECT_EQ(Tests().TestPosition(feature(), m, Predicted(Truth())), Verdict::kTooUncertain);
  // Half as much is allowed to what comes back.
  m.shape *= 0.25;
  EXPECT_EQ(Tests().TestPosition(feature(), m, Predicted(Truth())), Verdict::kObserved);
  feature().confirmed = false;
  EXPECT_EQ(Tests().TestPosition(feature(), m, Predicted(Truth())), Verdict::kTooUncertain);
}

TEST_F(ConfirmationTest, WhatIsElsewhereThanTheOthersSayIsNotIt) {
  const Eigen::Vector2d elsewhere = Truth() + Eigen::Vector2d(5, 0);
  EXPECT_EQ(Tests().TestPosition(feature(), Measured(Truth()), Predicted(elsewhere, 0.1)),
            Verdict::kNotWhereExpected);
  // Unless they hardly know.
  EXPECT_EQ(Tests().TestPosition(feature(), Measured(Truth()), Predicted(elsewhere, 1.4)),
            Verdict::kObserved);
}

TEST_F(ConfirmationTest, WhatAnOccluderPushedAwayIsNotObserved) {
  Hide(6);
  const Eigen::Vector2d pushed = Truth() + Eigen::Vector2d(1.5, 0);
  EXPECT_EQ(Tests().TestPosition(feature(), Measured(pushed), Predicted(Truth())),
            Verdict::kPushed);
}

TEST_F(ConfirmationTest, WithAWeakConstraintOnlyTheDistanceFromThePredictionCounts) {
  const Eigen::Vector2d elsewhere = Truth() + Eigen::Vector2d(4, 0);
  const Confirmation tests = Tests();
  const auto verdict = [&](bool strong) {
    return tests.TestPatchAtPrediction(
        feature(), Measured(Truth()), Predicted(elsewhere, 0.1), strong);
  };
  EXPECT_EQ(verdict(false), Verdict::kObserved);
  EXPECT_EQ(verdict(true), Verdict::kNotWhereExpected);
}

TEST_F(ConfirmationTest, WhatIsMeasuredWellGetsANarrowPatch) {
  Measurement m = Measured(Truth());
  const Confirmation tests = Tests();
  m.shape = 0.3 / calibration_.scale() * Eigen::Matrix2d::Identity();
  tests.Learn(m, feature());
  EXPECT_EQ(feature().window_px, 31);
  m.shape = 0.2 / calibration_.scale() * Eigen::Matrix2d::Identity();
  tests.Learn(m, feature());
  EXPECT_EQ(feature().window_px, 21);
}

TEST_F(ConfirmationTest, WhatIsHiddenIsHeldAndWhatIsNotEndsAfterSomeFrames) {
  const auto lost_after = [&](int frames) {
    feature().unexplained_frames = 0;
    const Confirmation tests = Tests();
    for (int t = 1; t <= frames; ++t) {
      const TrajectoryModel::Estimate predicted = Predicted(Truth());
      const Move move = HoldOrEnd({0, 0}, &predicted, tests, 4, 5.0, feature());
      EXPECT_EQ(move.state, ObservationState::kPredicted);
      EXPECT_EQ(move.xy, Truth());
      if (move.loss) return t;
    }
    return 0;
  };
  EXPECT_EQ(lost_after(20), 5);
  Hide(4);
  EXPECT_EQ(lost_after(20), 0);
}

TEST_F(ConfirmationTest, WhatChangedSlowlyOrIsNowhereKnownEnds) {
  Hide(4);
  const Confirmation tests = Tests();
  const TrajectoryModel::Estimate vague = Predicted(Truth(), 6.0);
  EXPECT_EQ(HoldOrEnd({0, 0}, &vague, tests, 4, 5.0, feature()).loss, LossReason::kContradicted);
  EXPECT_FALSE(HoldOrEnd({0, 0}, &vague, tests, 0, 5.0, feature()).loss);
  const TrajectoryModel::Estimate clear = Predicted(Truth());
  EXPECT_FALSE(HoldOrEnd({0, 0}, &clear, tests, 4, 5.0, feature()).loss);
  feature().change = 1.3;
  EXPECT_EQ(HoldOrEnd({0, 0}, &clear, tests, 4, 5.0, feature()).loss, LossReason::kContradicted);
}

TEST_F(ConfirmationTest, WithoutAPredictionAFeatureStaysAtItsGuide) {
  const Move move = HoldOrEnd({12, 13}, nullptr, Tests(), 4, 5.0, feature());
  EXPECT_EQ(move.xy, Eigen::Vector2d(12, 13));
  EXPECT_FALSE(move.loss);
}

}  // namespace
}  // namespace cohort
