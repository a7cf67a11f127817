#pragma once

#include <Eigen/Core>

#include "frontend/track/trajectory_model/observation.h"

namespace cohort::trajectory_model {

// Upper bound of a feature's unknowns (z, e) and of a camera's columns.
inline constexpr int kMaxDimensions = 12;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxDimensions, 1>;
using Matrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDimensions, kMaxDimensions>;
using Jacobian = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxDimensions>;

// A frame's camera C = [m B; 1 c'], 3 x (r + 1), with r the model's rank. With r = 3 it is a
// projective camera in the projective frame of the coordinates z; with c = 0 an affine one.
using Camera = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxDimensions>;

// The estimate of a feature: mean and covariance of its r + 2 unknowns (z, e). z are its
// coordinates; e [px] is the error of its anchor, which all its measurements share.
struct FeaturePosterior {
  Vector mean;  // empty: never fitted
  Matrix covariance;
};

// With h = C [1 z]: xy = (h_1, h_2) / h_3, that is (m + B z) / (1 + c'z).
struct Projection {
  Eigen::Vector2d xy;
  Eigen::Matrix<double, 2, 3> of_homogeneous;  // d xy / d h
  Jacobian of_z;                               // d xy / d z
};
inline constexpr double kLeastDepth = 0.1;
// `z`: the coordinates come first; further entries are ignored. Depths h_3 are bounded below by a
// tenth of the features' mean (which is 1), which avoids a division by zero.
Projection Project(const Camera& camera, const Vector& z);

// y - xy - e; y - xy in the frame of the anchor itself, where the position is exact by definition.
Eigen::Vector2d Residual(const Projection& projection,
                         const Observation& o,
                         const FeaturePosterior& feature);

// Fixes what nothing measures in the normal equations of vec(C): the scale of C by its entry 1, and
// in an affine model all of c.
void FixCameraGauge(bool perspective, Eigen::Ref<Eigen::MatrixXd> normal);

}  // namespace cohort::trajectory_model
