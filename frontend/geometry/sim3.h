#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "frontend/geometry/rigid3.h"

namespace cohort {

// A similarity target_from_source:  x_in_target = scale * (rotation * x_in_source) + translation.
struct Sim3 {
  double scale = 1.0;
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& x_in_source) const {
    return scale * (rotation * x_in_source) + translation;
  }
  Sim3 Inverse() const {
    const Eigen::Quaterniond inverse = rotation.conjugate();
    return {1.0 / scale, inverse, -(inverse * translation) / scale};
  }
};

// The pose of a camera after a change of world: cam_from_target of a cam_from_source, in the
// target's units.
inline Rigid3 TransformPose(const Sim3& target_from_source, const Rigid3& cam_from_source) {
  const Eigen::Quaterniond rotation =
      (cam_from_source.rotation * target_from_source.rotation.conjugate()).normalized();
  return {rotation,
          target_from_source.scale * cam_from_source.translation -
              rotation * target_from_source.translation};
}

}  // namespace cohort
