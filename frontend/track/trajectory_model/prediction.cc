#include "frontend/track/trajectory_model/prediction.h"

namespace cohort::trajectory_model {
namespace {

// The deviation of what depth, whose dimension has not shown yet, may add; chosen by eye on the
// tuning clips.
constexpr double kUnknownDepthPx = 1.5;

}  // namespace

Estimate PredictFeature(const CameraFit& fit, const Feature& feature) {
  const Eigen::Index r = fit.camera.cols() - 1;
  const Projection at = Project(fit.camera, feature.mean);
  Jacobian J(2, r + 2);
  J.leftCols(r) = at.of_z;
  J.rightCols(2).setZero();
  Vector z(r + 1);
  z << 1.0, feature.mean.head(r);
  Eigen::Matrix3d homogeneous = Eigen::Matrix3d::Zero();  // cov(C [1 z]) by that of C
  for (Eigen::Index p = 0; p <= r; ++p) {
    for (Eigen::Index q = 0; q <= r; ++q) {
      homogeneous += z[p] * z[q] * fit.covariance.block<3, 3>(3 * p, 3 * q);
    }
  }
  Eigen::Matrix2d of_camera = at.of_homogeneous * homogeneous * at.of_homogeneous.transpose();
  if (r < 3) of_camera += kUnknownDepthPx * kUnknownDepthPx * Eigen::Matrix2d::Identity();
  Estimate e;
  e.xy = at.xy;
  e.covariance = J * feature.covariance * J.transpose() + of_camera;
  e.expected_xy = e.xy + feature.mean.tail<2>();
  J.rightCols(2).setIdentity();
  e.measured_covariance = J * feature.covariance * J.transpose() + of_camera;
  return e;
}

std::vector<Estimate> PredictAllFeatures(const State& state, const CameraFit& fit) {
  std::vector<Estimate> estimates;
  estimates.reserve(state.features.size());
  for (const Feature& feature : state.features) estimates.push_back(PredictFeature(fit, feature));
  return estimates;
}

}  // namespace cohort::trajectory_model
