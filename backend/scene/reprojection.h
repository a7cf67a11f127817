#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "frontend/geometry/camera.h"

namespace cohort {

// A camera's pose as bundle adjustment holds it: rotation cam_from_world and its centre c in the
// world, so that x_in_cam = R (x_in_world - c). It moves by a 6-vector (omega, d):
// R <- exp([omega]x) R, c <- c + d.
struct CameraPose {
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
};

inline CameraPose MovedPose(CameraPose pose, const Eigen::Matrix<double, 6, 1>& step) {
  const double angle = step.head<3>().norm();
  if (angle > 0.0) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, step.head<3>() / angle));
    pose.rotation = (turn * pose.rotation).normalized();
  }
  pose.center += step.tail<3>();
  return pose;
}

// The normalised image point n(x) = (X/Z, Y/Z) of a point and its derivatives with respect to the
// pose's 6-vector and the point.
struct NormalisedProjection {
  Eigen::Vector2d n;
  Eigen::Matrix<double, 2, 6> d_pose;
  Eigen::Matrix<double, 2, 3> d_point;
};
inline NormalisedProjection ProjectNormalised(const CameraPose& pose,
                                              const Eigen::Vector3d& x_in_world) {
  const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
  const Eigen::Vector3d x = rotation * (x_in_world - pose.center);
  // Near the camera's plane the depth is bounded, so that the solver gets finite numbers.
  const double z = std::abs(x.z()) > 1e-9 ? x.z() : std::copysign(1e-9, x.z());
  const double w = 1.0 / z;
  NormalisedProjection result;
  result.n = x.head<2>() * w;
  const double a = result.n.x();
  const double b = result.n.y();
  result.d_point.row(0) = w * (rotation.row(0) - a * rotation.row(2));
  result.d_point.row(1) = w * (rotation.row(1) - b * rotation.row(2));
  // d x / d omega = -[x]x, and d n / d x = w [1 0 -a; 0 1 -b].
  result.d_pose << -a * b, 1.0 + a * a, -b, -result.d_point.row(0),  //
      -(1.0 + b * b), a * b, a, -result.d_point.row(1);
  return result;
}

// The intrinsics that bundle adjustment may refine: (focal length fx, cx, cy, k1, k2). fy keeps its
// ratio to fx; p1, p2 and k3 to k6 keep their values.
using IntrinsicVector = Eigen::Matrix<double, 5, 1>;
inline IntrinsicVector ToIntrinsicVector(const Camera& camera) {
  return {camera.fx, camera.cx, camera.cy, camera.k1, camera.k2};
}
inline Camera WithIntrinsics(Camera camera, const IntrinsicVector& v) {
  camera.fy = v[0] * (camera.fy / camera.fx);  // exactly v[0] where fx = fy
  camera.fx = v[0];
  camera.cx = v[1];
  camera.cy = v[2];
  camera.k1 = v[3];
  camera.k2 = v[4];
  return camera;
}

// The pixel of a normalised image point and its derivatives w.r.t. the point and the intrinsics.
struct PixelProjection {
  Eigen::Vector2d xy;
  Eigen::Matrix2d d_n;
  Eigen::Matrix<double, 2, 5> d_intrinsics;
};
inline PixelProjection ProjectPixelByDistort(const Camera& camera, const Eigen::Vector2d& n) {
  const DistortedPoint distorted = Distort(camera, n);
  const Eigen::Vector2d focal(camera.fx, camera.fy);
  PixelProjection result;
  result.xy = focal.cwiseProduct(distorted.n_d) + Eigen::Vector2d(camera.cx, camera.cy);
  result.d_n = focal.asDiagonal() * distorted.d_n;
  result.d_intrinsics.col(0) << distorted.n_d.x(), distorted.n_d.y() * camera.fy / camera.fx;
  result.d_intrinsics.middleCols<2>(1).setIdentity();
  result.d_intrinsics.rightCols<2>() = focal.asDiagonal() * distorted.d_k1_k2;
  return result;
}
inline PixelProjection ProjectPixel(const Camera& camera, const Eigen::Vector2d& n) {
  if (!camera.HasAtMostFourCoefficients()) return ProjectPixelByDistort(camera, n);
  // The same in a fixed order of operations, which keeps the results of these cameras unchanged.
  const double x = n.x();
  const double y = n.y();
  const double r2 = n.squaredNorm();
  const double radial = 1.0 + camera.k1 * r2 + camera.k2 * r2 * r2;
  const double slope = camera.k1 + 2.0 * camera.k2 * r2;  // d radial / d r2
  const double p1 = camera.p1;
  const double p2 = camera.p2;
  const Eigen::Vector2d d(x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
                          y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y);
  const double mixed = 2.0 * x * y * slope + 2.0 * p1 * x + 2.0 * p2 * y;
  const double fx = camera.fx;
  const double fy = camera.fy;
  PixelProjection result;
  result.xy << fx * d.x() + camera.cx, fy * d.y() + camera.cy;
  result.d_n << fx * (radial + 2.0 * x * x * slope + 2.0 * p1 * y + 6.0 * p2 * x), fx * mixed,
      fy * mixed, fy * (radial + 2.0 * y * y * slope + 6.0 * p1 * y + 2.0 * p2 * x);
  result.d_intrinsics << d.x(), 1.0, 0.0, fx * x * r2, fx * x * r2 * r2,  //
      d.y() * fy / fx, 0.0, 1.0, fy * y * r2, fy * y * r2 * r2;
  return result;
}

}  // namespace cohort
