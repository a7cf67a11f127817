// The Cramer-Rao bound of a patch's position, against closed forms and against real noise.
#include "datasets/truth/position_bound.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <vector>

#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

constexpr int kSide = 64;
constexpr int kWindowPx = 21;
const Eigen::Vector2d kCentre(31.2, 32.4);

DegradeOptions Options(DegradeRecipe recipe, double level) {
  DegradeOptions options;
  options.recipe = recipe;
  options.level = level;
  return options;
}

// Not near black or white, where noise would be clipped.
cv::Mat Picture() {
  return test::ImageOf(
      [](double x, double y) { return 0.45 + 0.3 * test::NoiseAt(x, y); }, kSide, kSide, CV_8U);
}

Eigen::Matrix2d Bound(const DegradeOptions& options, const cv::Mat& picture = Picture()) {
  const auto signal = PositionBound::Prepare(NoiseFreeSignal(picture, options, 0));
  return PositionBound(options, kWindowPx).Covariance(signal, kCentre).value();
}

// sum over the window of gradient gradient^T
Eigen::Matrix2d GradientEnergy(const cv::Mat& signal) {
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  for (int y = 32 - 10; y <= 32 + 10; ++y) {
    for (int x = 31 - 10; x <= 31 + 10; ++x) {
      const Eigen::Vector2d gradient(
          (signal.at<float>(y, x + 1) - signal.at<float>(y, x - 1)) / 2.0,
          (signal.at<float>(y + 1, x) - signal.at<float>(y - 1, x)) / 2.0);
      sum += gradient * gradient.transpose();
    }
  }
  return sum;
}

TEST(PositionBound, IsNoiseOverGradientEnergyWhereTheNoiseIsWhite) {
  const DegradeOptions clean = Options(DegradeRecipe::kPaper, 0.0);
  const double variance = 0.004 * 0.004 + 1.0 / (12.0 * 255.0 * 255.0);
  const Eigen::Matrix2d expected =
      variance * GradientEnergy(NoiseFreeSignal(Picture(), clean, 0)).inverse();
  EXPECT_LT((Bound(clean) - expected).norm(), 1e-6 * expected.norm());
}

TEST(PositionBound, BlurredNoiseCountsMoreThanItsSizeAndLessThanWhiteNoiseAtItsSource) {
  const DegradeOptions medium = Options(DegradeRecipe::kPaper, 1.0);
  const Eigen::Matrix2d white = GradientEnergy(NoiseFreeSignal(Picture(), medium, 0)).inverse();
  const double blurred_variance = 0.04 * 0.04 / (4.0 * M_PI * 2.0 * 2.0);
  const double bound = Bound(medium).trace();
  EXPECT_GT(bound, (0.02 * 0.02 + blurred_variance) * white.trace());
  EXPECT_LT(bound, (0.02 * 0.02 + 0.04 * 0.04) * white.trace());
}

// The unweighted least-squares shift that the noise of real degraded frames makes: unbiased, so the
// bound holds for it; and a 2 px blur leaves little to weigh.
TEST(PositionBound, IsNotBeatenByLeastSquaresOnRealNoise) {
  for (const double level : {0.0, 1.0}) {
    const DegradeOptions options = Options(DegradeRecipe::kPaper, level);
    const cv::Mat signal = NoiseFreeSignal(Picture(), options, 0);
    const Eigen::Matrix2d energy = GradientEnergy(signal);
    constexpr int kFrames = 600;
    Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
    for (int frame = 0; frame < kFrames; ++frame) {
      cv::Mat dark;
      DegradeFrame(Picture(), options, static_cast<std::uint32_t>(frame))
          .convertTo(dark, CV_32F, 1.0 / 255.0);
      Eigen::Vector2d sum = Eigen::Vector2d::Zero();
      for (int y = 32 - 10; y <= 32 + 10; ++y) {
        for (int x = 31 - 10; x <= 31 + 10; ++x) {
          const Eigen::Vector2d gradient(
              (signal.at<float>(y, x + 1) - signal.at<float>(y, x - 1)) / 2.0,
              (signal.at<float>(y + 1, x) - signal.at<float>(y - 1, x)) / 2.0);
          sum += gradient * (dark.at<float>(y, x) - signal.at<float>(y, x));
        }
      }
      const Eigen::Vector2d shift = energy.inverse() * sum;
      scatter += shift * shift.transpose() / kFrames;
    }
    const double ratio = scatter.trace() / Bound(options).trace();
    EXPECT_GT(ratio, 0.9) << "level " << level;
    EXPECT_LT(ratio, level == 0.0 ? 1.1 : 2.0) << "level " << level;
  }
}

TEST(PositionBound, OfTheSensorFallsWithLight) {
  const double medium = Bound(Options(DegradeRecipe::kSensor, 1.0)).trace();
  const double hard = Bound(Options(DegradeRecipe::kSensor, 2.0)).trace();
  const double clean = Bound(Options(DegradeRecipe::kSensor, 0.0)).trace();
  EXPECT_LT(clean, 0.05 * medium);
  EXPECT_LT(medium, 0.7 * hard);
}

TEST(PositionBound, ThereIsNoneWithoutTexture) {
  const DegradeOptions medium = Options(DegradeRecipe::kPaper, 1.0);
  const auto signal = PositionBound::Prepare(
      NoiseFreeSignal(cv::Mat(kSide, kSide, CV_8U, cv::Scalar(99)), medium, 0));
  EXPECT_FALSE(PositionBound(medium, kWindowPx).Covariance(signal, kCentre));
}

}  // namespace
}  // namespace cohort
