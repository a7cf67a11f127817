// MeasurePatch on pictures in closed form, moved and warped by known amounts.

#include "frontend/track/measure/measurement.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "frontend/core/random_stream.h"
#include "frontend/image/pyramid.h"
#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

constexpr int kWidth = 200;
constexpr int kHeight = 160;
constexpr int kWindowPx = 21;
constexpr double kNoiseFactor =
    10.0;  // of independent pixels it would be 1; the tests' prior is wide
const Eigen::Vector2d kFeature(100.0, 80.0);

// The picture in which what was at kFeature + v is at kFeature + shift + warp v.
cv::Mat MovedPicture(const Eigen::Vector2d& shift,
                     const Eigen::Matrix2d& warp = Eigen::Matrix2d::Identity()) {
  const Eigen::Matrix2d back = warp.inverse();
  return test::ImageOf(
      [&](double x, double y) {
        const Eigen::Vector2d then = kFeature + back * (Eigen::Vector2d(x, y) - kFeature - shift);
        return test::WavesAt(then.x(), then.y());
      },
      kWidth,
      kHeight,
      CV_32F);
}

Pyramid TwoLevels(const cv::Mat& picture) { return BuildPyramid(picture, 2); }

AnchorPatch AnchorOf(const cv::Mat& picture) {
  return TakeAnchor(TwoLevels(picture), kFeature, kWindowPx, kWindowPx);
}

Measurement Measure(const cv::Mat& picture,
                    const AnchorPatch& anchor,
                    const Eigen::Vector2d& guide,
                    double noise_factor = kNoiseFactor) {
  return MeasurePatch(TwoLevels(picture), anchor, guide, kWindowPx, noise_factor);
}

cv::Mat WithNoise(const cv::Mat& picture, double sigma, RandomStream& random) {
  cv::Mat noisy = picture.clone();
  for (int y = 0; y < noisy.rows; ++y) {
    for (int x = 0; x < noisy.cols; ++x) {
      noisy.at<float>(y, x) += static_cast<float>(sigma * random.Gaussian());
    }
  }
  return noisy;
}

TEST(MeasurePatch, FindsAShiftToAHundredthOfAPixel) {
  const AnchorPatch anchor = AnchorOf(MovedPicture({0.0, 0.0}));
  for (const Eigen::Vector2d& shift : {Eigen::Vector2d(0.0, 0.0),
                                       Eigen::Vector2d(0.37, -0.21),
                                       Eigen::Vector2d(-2.6, 1.45),
                                       Eigen::Vector2d(3.5, 3.5)}) {
    const Measurement m = Measure(MovedPicture(shift), anchor, kFeature);
    ASSERT_TRUE(m.converged);
    EXPECT_LT((m.xy - kFeature - shift).norm(), 0.01) << shift.transpose();
    EXPECT_GT(m.correlation, 0.999);
    EXPECT_LT(m.residual_variance, 1e-5);
  }
}

TEST(ExpectedCorrelation, IsThatOfThePatternUnderBothNoises) {
  EXPECT_DOUBLE_EQ(ExpectedCorrelation(1.0, 0.0, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(ExpectedCorrelation(2.0, 1.0, 1.0), 0.5);
  EXPECT_DOUBLE_EQ(ExpectedCorrelation(1.0, 0.0, 3.0), 0.5);
  EXPECT_EQ(ExpectedCorrelation(1.0, 1.0, 1.0), 0.0);
  EXPECT_EQ(ExpectedCorrelation(0.0, 0.0, 0.0), 0.0);
}

// Between four neighbours, which a picture of one row or column has not.
TEST(CopyAnchor, OfAPictureOnePixelWideIsThatPixels) {
  const Eigen::Matrix2d warp = Eigen::Rotation2Dd(0.1).toRotationMatrix();
  for (const cv::Size size : {cv::Size(40, 1), cv::Size(1, 40), cv::Size(1, 1)}) {
    const cv::Mat picture(size, CV_32FC1, cv::Scalar(0.25));
    const AnchorPatch anchor =
        CopyAnchor(BuildPyramid(picture, 2), {0.5 * size.width, 0.5 * size.height}, 21, warp);
    EXPECT_EQ(cv::countNonZero(anchor.full != 0.25F), 0) << size.width << " x " << size.height;
  }
}

TEST(MeasurePatch, DoesNotMindADifferenceOfBrightness) {
  const AnchorPatch anchor = AnchorOf(MovedPicture({0.0, 0.0}));
  const Eigen::Vector2d shift(0.8, -0.6);
  const cv::Mat brighter = MovedPicture(shift) + 0.1;
  const Measurement m = Measure(brighter, anchor, kFeature);
  ASSERT_TRUE(m.converged);
  EXPECT_LT((m.xy - kFeature - shift).norm(), 0.02);
  EXPECT_LT(m.residual_variance, 1e-5) << "the mean difference does not count";
  EXPECT_NEAR(m.residual, 0.1, 0.01) << "the mean absolute difference does";
}

TEST(MeasurePatch, FindsAWarpStepByStep) {
  Eigen::Matrix2d per_frame;
  per_frame << 1.012, 0.01, -0.008, 1.006;
  AnchorPatch anchor = AnchorOf(MovedPicture({0.0, 0.0}));
  anchor.warp_covariance = 0.05 * 0.05 * Eigen::Matrix4d::Identity();
  Eigen::Matrix2d warp = Eigen::Matrix2d::Identity();
  for (int frame = 1; frame <= 8; ++frame) {
    warp = per_frame * warp;
    const Measurement m = Measure(MovedPicture({0.0, 0.0}, warp), anchor, kFeature);
    ASSERT_TRUE(m.converged);
    EXPECT_LT((m.xy - kFeature).norm(), 0.05) << "frame " << frame;
    anchor.warp = m.warp;
    anchor.warp_covariance = m.warp_covariance;
    anchor.warp_covariance.diagonal().array() += 0.01 * 0.01;
  }
  EXPECT_LT((anchor.warp - warp).norm(), 0.02);
  EXPECT_GT((Eigen::Matrix2d::Identity() - warp).norm(), 0.1) << "the test warps by less";
}

TEST(MeasurePatch, KeepsTheWarpThatItIsToldWhereItIsSure) {
  AnchorPatch anchor = AnchorOf(MovedPicture({0.0, 0.0}));
  anchor.warp_covariance.setZero();
  Eigen::Matrix2d warp;
  warp << 1.02, 0.0, 0.0, 1.02;
  const Measurement m = Measure(MovedPicture({0.0, 0.0}, warp), anchor, kFeature);
  ASSERT_TRUE(m.converged);
  EXPECT_LT((m.warp - Eigen::Matrix2d::Identity()).norm(), 1e-4);
}

// The scatter over noise, against the covariance `shape` that is said for white noise.
TEST(MeasurePatch, ShapeIsTheScatterUpToAFactor) {
  // Coarse stripes, and half as strong the other way: y is measured worse than x.
  const cv::Mat picture = test::ImageOf(
      [](double x, double y) { return 0.5 + 0.2 * std::sin(0.5 * x) + 0.1 * std::sin(0.4 * y); },
      kWidth,
      kHeight,
      CV_32F);
  constexpr double kSigma = 0.02;
  constexpr int kPictures = 400;
  RandomStream random(3, "test/measurement/scatter");
  const AnchorPatch anchor = AnchorOf(picture);
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d shape = Eigen::Matrix2d::Zero();
  for (int i = 0; i < kPictures; ++i) {
    const Measurement m = Measure(WithNoise(picture, kSigma, random), anchor, kFeature);
    ASSERT_TRUE(m.converged);
    const Eigen::Vector2d d = m.xy - kFeature;
    scatter += d * d.transpose() / kPictures;
    shape += m.shape / kPictures;
  }
  const double factor = scatter.trace() / shape.trace();
  EXPECT_GT(factor, 0.5);  // pixels are independent here
  EXPECT_LT(factor, 2.0);
  EXPECT_GT(scatter(1, 1), 3.0 * scatter(0, 0)) << "the test's picture has no weak direction";
  for (int axis = 0; axis < 2; ++axis) {
    const double ratio = scatter(axis, axis) / (factor * shape(axis, axis));
    EXPECT_GT(ratio, 0.6) << "axis " << axis;
    EXPECT_LT(ratio, 1.6) << "axis " << axis;
  }
}

TEST(MeasurePatch, APriorPullsTowardsTheGuide) {
  const cv::Mat picture = MovedPicture({0.0, 0.0});
  const AnchorPatch anchor = AnchorOf(picture);
  const Eigen::Vector2d guide = kFeature + Eigen::Vector2d(1.0, 0.0);
  constexpr double kNoiseVariance = 1e-4;
  const auto distance = [&](double sigma_px) {
    const Eigen::Matrix2d prior = Eigen::Matrix2d::Identity() / (sigma_px * sigma_px);
    const Measurement m = MeasurePatch(
        TwoLevels(picture), anchor, guide, kWindowPx, kNoiseFactor, kNoiseVariance, prior);
    EXPECT_TRUE(m.converged);
    return (m.xy - kFeature).norm();
  };
  EXPECT_LT(distance(10.0), 0.02) << "a wide prior says nothing";
  EXPECT_GT(distance(0.001), 0.9) << "a narrow one decides";
  EXPECT_LT(distance(10.0), distance(0.05));
  EXPECT_LT(distance(0.05), distance(0.001));
}

TEST(MeasurePatch, DoesNotConvergeWithoutTexture) {
  const cv::Mat gray(kHeight, kWidth, CV_32FC1, cv::Scalar(0.4));
  EXPECT_FALSE(Measure(gray, AnchorOf(gray), kFeature).converged);
}

// A picture's border repeats outside it: what is half outside is measured by what is inside.
TEST(MeasurePatch, AtTheBorderIsMeasuredByWhatIsInside) {
  const Eigen::Vector2d shift(0.4, 0.3);
  const auto picture = [](const Eigen::Vector2d& by) {
    return test::WavesImage(kWidth, kHeight, by.x(), by.y(), CV_32F);
  };
  const Eigen::Vector2d corner(8.0, 9.0);
  const AnchorPatch anchor =
      TakeAnchor(TwoLevels(picture({0.0, 0.0})), corner, kWindowPx, kWindowPx);
  const Measurement m =
      MeasurePatch(TwoLevels(picture(shift)), anchor, corner, kWindowPx, kNoiseFactor);
  ASSERT_TRUE(m.converged);
  EXPECT_LT((m.xy - corner - shift).norm(), 0.2);
  // Outside altogether, where nothing but the repeated border is: no position that is not finite.
  const Measurement outside =
      MeasurePatch(TwoLevels(picture(shift)), anchor, {-40.0, -40.0}, kWindowPx, kNoiseFactor);
  EXPECT_TRUE(!outside.converged || outside.xy.allFinite());
}

TEST(MeasurePatch, ComparesTheInnermostPixelsWhereItFindsTheFeature) {
  cv::Mat picture = MovedPicture({1.2, -0.7});
  picture(cv::Rect(98, 76, 5, 5)) += 0.1F;  // a light before it
  const AnchorPatch anchor = AnchorOf(MovedPicture({0.0, 0.0}));
  const Pyramid pyramid = TwoLevels(picture);
  const Measurement m = MeasurePatch(pyramid, anchor, kFeature, kWindowPx, kNoiseFactor);
  ASSERT_TRUE(m.converged);
  const CenterDifference there = CompareCenter(pyramid, anchor, m.xy);
  EXPECT_GT(there.mean, 0.02);
  EXPECT_NEAR(m.center.mean, there.mean, 0.002);
  EXPECT_NEAR(m.center.variance, there.variance, 0.1 * there.variance);
}

TEST(CompareCenter, TellsWhatStandsBeforeTheFeature) {
  const cv::Mat picture = MovedPicture({0.0, 0.0});
  const AnchorPatch anchor = AnchorOf(picture);
  const CenterDifference same = CompareCenter(TwoLevels(picture), anchor, kFeature);
  EXPECT_NEAR(same.mean, 0.0, 1e-6);
  EXPECT_NEAR(same.variance, 0.0, 1e-6);
  cv::Mat covered = picture.clone();
  covered(cv::Rect(94, 74, 13, 13)).setTo(0.9F);
  const CenterDifference other = CompareCenter(TwoLevels(covered), anchor, kFeature);
  EXPECT_GT(other.mean, 0.1);
  EXPECT_GT(other.variance, 1e-4);
}

TEST(TrackWindow, FindsNothingInABlackPicture) {
  const Pyramid here = TwoLevels(MovedPicture({0.0, 0.0}));
  const Pyramid black = TwoLevels(cv::Mat::zeros(kHeight, kWidth, CV_32F));
  EXPECT_TRUE(TrackWindow(here, here, kFeature, kFeature, kWindowPx, 0));
  EXPECT_FALSE(TrackWindow(here, black, kFeature, kFeature, kWindowPx, 0));
  EXPECT_FALSE(TrackWindow(black, here, kFeature, kFeature, kWindowPx, 0));
}

}  // namespace
}  // namespace cohort
