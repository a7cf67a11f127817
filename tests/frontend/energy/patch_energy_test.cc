#include "frontend/energy/patch_energy.h"

#include <gtest/gtest.h>

#include <vector>

#include "frontend/image/frame_offset.h"
#include "frontend/image/sampling.h"
#include "tests/support/closed_form_image.h"
#include "tests/support/numeric_gradient.h"

namespace cohort {
namespace {

std::vector<float> PatchAt(const cv::Mat& picture, double x, double y, int n) {
  std::vector<float> patch(static_cast<std::size_t>(n) * n);
  SamplePatch(picture, x, y, n, patch.data());
  return patch;
}

TEST(Sampling, InterpolatesTheClosedFormPicture) {
  const cv::Mat picture = test::WavesImage(80, 60, 0, 0, CV_32F);
  const std::vector<float> patch = PatchAt(picture, 40.3, 30.8, 7);
  for (int v = 0; v < 7; ++v) {
    for (int u = 0; u < 7; ++u) {
      EXPECT_NEAR(patch[v * 7 + u], test::WavesAt(40.3 + u - 3, 30.8 + v - 3), 0.01);
    }
  }
}

TEST(Sampling, RepeatsTheBorderOutsideThePicture) {
  const cv::Mat picture = test::WavesImage(40, 30, 0, 0, CV_32F);
  for (const float v : PatchAt(picture, -500, -500, 5)) EXPECT_EQ(v, picture.at<float>(0, 0));
  for (const float v : PatchAt(picture, 500, 500, 5)) EXPECT_EQ(v, picture.at<float>(29, 39));
  const std::vector<float> corner = PatchAt(picture, 0, 0, 3);
  EXPECT_EQ(corner[0], picture.at<float>(0, 0));
  EXPECT_EQ(corner[8], picture.at<float>(1, 1));
}

TEST(PatchEnergy, IsZeroWhereTheTemplateWasTaken) {
  const cv::Mat picture = test::WavesImage(80, 60, 0, 0, CV_32F);
  EXPECT_EQ(PatchEnergy(picture, {40.25, 30.5}, PatchAt(picture, 40.25, 30.5, 11), 11), 0.0);
}

TEST(PatchEnergy, GradientMatchesCentralDifferences) {
  const cv::Mat picture = test::WavesImage(80, 60, 0, 0, CV_32F);
  const std::vector<float> patch = PatchAt(picture, 40.25, 30.5, 7);
  for (const Eigen::Vector2d& x :
       {Eigen::Vector2d(43.4, 28.3), Eigen::Vector2d(39.7, 33.6), Eigen::Vector2d(37.2, 30.4)}) {
    const PatchGradient at = PatchEnergyGradient(picture, x, patch, 7);
    EXPECT_DOUBLE_EQ(at.energy, PatchEnergy(picture, x, patch, 7));
    const Eigen::Vector2d numeric = test::NumericGradient(
        [&](const Eigen::Vector2d& y) { return PatchEnergy(picture, y, patch, 7); }, x, 2e-3);
    EXPECT_LT((at.gradient - numeric).norm(), 0.03 * numeric.norm());
  }
}

TEST(PatchEnergy, QuadraticTouchesTheEnergyFromAbove) {
  const cv::Mat picture = test::WavesImage(80, 60, 0, 0, CV_32F);
  const std::vector<float> patch = PatchAt(picture, 40.25, 30.5, 7);
  const Eigen::Vector2d x(42.3, 29.4);
  const PatchQuadratic q = PatchEnergyQuadratic(picture, x, patch, 7, 1e-3);
  EXPECT_NEAR(q.energy, PatchEnergy(picture, x, patch, 7), 1e-6);
  for (double angle = 0.0; angle < 6.2; angle += 0.5) {
    const Eigen::Vector2d d = 0.3 * Eigen::Vector2d(std::cos(angle), std::sin(angle));
    const double model = q.energy + q.gradient.dot(d) + 0.5 * d.dot(q.hessian * d);
    EXPECT_GT(model, PatchEnergy(picture, x + d, patch, 7) - 1e-3);
  }
}

TEST(RegisterFrames, FindsAShiftOfTheWholeFrame) {
  const Pyramid previous = BuildPyramid(test::SpotsImage(640, 480, 0, 0));
  for (const Eigen::Vector2d& shift :
       {Eigen::Vector2d(0, 0), Eigen::Vector2d(5.3, -2.7), Eigen::Vector2d(-11, 7)}) {
    const Pyramid current = BuildPyramid(test::SpotsImage(640, 480, shift.x(), shift.y()));
    EXPECT_LT((RegisterFrames(previous, current) - shift).norm(), 1.0);
  }
}

}  // namespace
}  // namespace cohort
