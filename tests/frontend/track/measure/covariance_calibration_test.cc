#include "frontend/track/measure/covariance_calibration.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <vector>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

// Distances of what is measured from what is predicted, when the true scale is `scale`.
std::vector<CovarianceCalibration::Sample> Samples(double scale, int count, RandomStream& random) {
  Eigen::Matrix2d shape;
  shape << 0.02, 0.005, 0.005, 0.01;
  const Eigen::Matrix2d predicted = 0.03 * Eigen::Matrix2d::Identity();
  const Eigen::Matrix2d root = (predicted + 0.5 * scale * shape).llt().matrixL();
  std::vector<CovarianceCalibration::Sample> samples;
  for (int i = 0; i < count; ++i) {
    const double u = random.Gaussian();
    const double v = random.Gaussian();
    samples.push_back({root * Eigen::Vector2d(u, v), predicted, shape});
  }
  return samples;
}

TEST(CovarianceCalibration, FindsTheScaleThatExplainsTheDistances) {
  for (const double truth : {3.0, 30.0}) {
    RandomStream random(1, "test/calibration");
    CovarianceCalibration calibration;
    for (int frame = 0; frame < 60; ++frame) calibration.Update(Samples(truth, 300, random));
    EXPECT_NEAR(calibration.scale(), truth, 0.15 * truth);
  }
}

TEST(CovarianceCalibration, FollowsQuicklyAtFirstAndSlowlyLater) {
  RandomStream random(2, "test/calibration");
  CovarianceCalibration calibration;
  const double start = calibration.scale();
  for (int frame = 0; frame < 5; ++frame) calibration.Update(Samples(40.0, 300, random));
  EXPECT_GT(calibration.scale(), 2.0 * start);
  const double before = calibration.scale();
  calibration.Update(Samples(4.0, 300, random));
  EXPECT_GT(calibration.scale(), 0.7 * before);
}

TEST(CovarianceCalibration, FewMeasurementsSayNothing) {
  RandomStream random(3, "test/calibration");
  CovarianceCalibration calibration;
  const double start = calibration.scale();
  calibration.Update(Samples(100.0, 7, random));
  EXPECT_EQ(calibration.scale(), start);
}

// Frames that repeat exactly, of a clip that is frozen.
TEST(CovarianceCalibration, WithoutAnyDifferenceStaysAboveNothing) {
  RandomStream random(4, "test/calibration");
  CovarianceCalibration calibration;
  for (int frame = 0; frame < 50; ++frame) calibration.Update(Samples(0.0, 30, random));
  EXPECT_GE(calibration.scale(), 0.05);
}

TEST(CovarianceCalibration, TheModelTakesThePicturesHalf) {
  const CovarianceCalibration calibration;
  Measurement m;
  m.xy = {3, 4};
  m.shape << 0.02, 0.005, 0.005, 0.01;
  const TrajectoryModel::Observation seen = calibration.ForModel(m);
  EXPECT_EQ(seen.xy, m.xy);
  EXPECT_TRUE((seen.information * calibration.Covariance(m.shape))
                  .isApprox(2.0 * Eigen::Matrix2d::Identity(), 1e-9));
}

}  // namespace
}  // namespace cohort
