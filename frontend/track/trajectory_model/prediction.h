#pragma once

#include <Eigen/Core>
#include <vector>

#include "frontend/track/trajectory_model/camera_fit.h"
#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

// Where a feature is in a frame [px].
struct Estimate {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();           // of the scene point
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();   // of xy
  Eigen::Vector2d expected_xy = Eigen::Vector2d::Zero();  // of a measurement, which includes e
  Eigen::Matrix2d measured_covariance = Eigen::Matrix2d::Zero();  // of expected_xy; no noise
};

// The projection P(C, z), and its covariance to first order,
//   cov xy = P_z cov(z) P_z' + P_C cov(vec C) P_C',   P_C = [1 z]' (x) d xy / d (C [1 z]);
// and for expected_xy = xy + e the same with [P_z I] cov(z, e) [P_z I]'. Camera and feature are
// treated as independent. Below rank 3 both covariances include the parallax that a rigid scene may
// still add.
Estimate PredictFeature(const CameraFit& fit, const FeaturePosterior& feature);
std::vector<Estimate> PredictAllFeatures(const State& state, const CameraFit& fit);

}  // namespace cohort::trajectory_model
