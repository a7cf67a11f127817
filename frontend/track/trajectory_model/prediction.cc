#include "frontend/track/trajectory_model/prediction.h"

#include "frontend/core/in_parallel.h"
#include "frontend/track/trajectory_model/sized.h"

namespace cohort::trajectory_model {
namespace {

// Standard deviation of the parallax that a depth dimension which has not shown yet may add. Tuned
// on the tuning clips.
constexpr double kUnknownDepthPx = 1.5;

template <int R>
Estimate PredictSized(const CameraFit& fit, const FeaturePosterior& feature) {
  const Eigen::Index r = fit.camera.cols() - 1;
  const auto mean = Sized<R>::MeanOf(feature);
  const auto at = ProjectSized<R>(Sized<R>::Of(fit.camera), mean);
  Eigen::Matrix3d homogeneous = Eigen::Matrix3d::Zero();  // cov(C [1 z]) by that of C
  for (Eigen::Index p = 0; p <= r; ++p) {
    for (Eigen::Index q = 0; q <= r; ++q) {
      const double zz = (p == 0 ? 1.0 : mean[p - 1]) * (q == 0 ? 1.0 : mean[q - 1]);
      homogeneous += zz * fit.covariance.block<3, 3>(3 * p, 3 * q);
    }
  }
  const Eigen::Matrix<double, 2, 3> H = at.OfHomogeneous();
  Eigen::Matrix2d of_camera = H * homogeneous * H.transpose();
  if (r < 3) of_camera += kUnknownDepthPx * kUnknownDepthPx * Eigen::Matrix2d::Identity();
  const auto covariance = Sized<R>::CovarianceOf(feature);
  Estimate e;
  e.xy = at.xy;
  e.covariance = CovarianceOfPosition<R>(at.of_z, covariance, false) + of_camera;
  e.expected_xy = e.xy + mean.template tail<2>();
  e.measured_covariance = CovarianceOfPosition<R>(at.of_z, covariance, true) + of_camera;
  return e;
}

}  // namespace

Estimate PredictFeature(const CameraFit& fit, const FeaturePosterior& feature) {
  return WithRank(static_cast<int>(fit.camera.cols()) - 1,
                  [&](auto rank) { return PredictSized<rank.value>(fit, feature); });
}

std::vector<Estimate> PredictAllFeatures(const State& state, const CameraFit& fit) {
  std::vector<Estimate> estimates(state.features.size());
  ForEachInParallel(estimates.size(),
                    [&](std::size_t f) { estimates[f] = PredictFeature(fit, state.features[f]); });
  return estimates;
}

}  // namespace cohort::trajectory_model
