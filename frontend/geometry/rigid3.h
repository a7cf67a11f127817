#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <optional>

namespace cohort {

// A rigid motion target_from_source:  x_in_target = rotation * x_in_source + translation.
// Named by both frames, e.g. cam_from_world; its inverse is world_from_cam, whose translation is
// the camera's centre.
struct Rigid3 {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const {
    return rotation * x_in_source + translation;
  }
  // c_from_b * b_from_a = c_from_a
  Rigid3 operator*(const Rigid3& b_from_a) const {
    return {(rotation * b_from_a.rotation).normalized(),
            rotation * b_from_a.translation + translation};
  }
  Rigid3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {inverse, -(inverse * translation)};
  }
};

// The motion of a 3x4 matrix [R t]; nullopt unless R is a rotation to 1e-3.
inline std::optional<Rigid3> RigidFromMatrix(const Eigen::Matrix<double, 3, 4>& matrix) {
  const Eigen::Matrix3d rotation = matrix.leftCols<3>();
  if (!rotation.isUnitary(1e-3) || rotation.determinant() < 0.0) return std::nullopt;
  return Rigid3{Eigen::Quaterniond(rotation).normalized(), matrix.col(3)};
}

// Angle between two rotations [rad].
inline double AngleBetween(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  const Eigen::Quaterniond d = a.conjugate() * b;
  return 2.0 * std::atan2(d.vec().norm(), std::abs(d.w()));
}

}  // namespace cohort
