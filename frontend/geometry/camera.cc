#include "frontend/geometry/camera.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>

namespace cohort {
namespace {

// n_d of n, and its Jacobian by n.
Eigen::Vector2d Distort(const Camera& camera, const Eigen::Vector2d& n, Eigen::Matrix2d* jacobian) {
  const double x = n.x();
  const double y = n.y();
  const double r2 = n.squaredNorm();
  const double radial = 1.0 + camera.k1 * r2 + camera.k2 * r2 * r2;
  if (jacobian != nullptr) {
    const double slope = camera.k1 + 2.0 * camera.k2 * r2;  // d radial / d r2
    (*jacobian)(0, 0) = radial + 2.0 * x * x * slope + 2.0 * camera.p1 * y + 6.0 * camera.p2 * x;
    (*jacobian)(0, 1) = 2.0 * x * y * slope + 2.0 * camera.p1 * x + 2.0 * camera.p2 * y;
    (*jacobian)(1, 0) = (*jacobian)(0, 1);
    (*jacobian)(1, 1) = radial + 2.0 * y * y * slope + 6.0 * camera.p1 * y + 2.0 * camera.p2 * x;
  }
  return {x * radial + 2.0 * camera.p1 * x * y + camera.p2 * (r2 + 2.0 * x * x),
          y * radial + camera.p1 * (r2 + 2.0 * y * y) + 2.0 * camera.p2 * x * y};
}

}  // namespace

std::optional<Eigen::Vector2d> Camera::Project(const Eigen::Vector3d& x_in_cam) const {
  if (x_in_cam.z() <= 0.0) return std::nullopt;
  const Eigen::Vector2d n = Distort(*this, x_in_cam.hnormalized(), nullptr);
  return Eigen::Vector2d(fx * n.x() + cx, fy * n.y() + cy);
}

Eigen::Vector2d Camera::Unproject(const Eigen::Vector2d& xy) const {
  const Eigen::Vector2d distorted((xy.x() - cx) / fx, (xy.y() - cy) / fy);
  if (!HasDistortion()) return distorted;
  Eigen::Vector2d n = distorted;
  for (int i = 0; i < 30; ++i) {
    Eigen::Matrix2d jacobian;
    const Eigen::Vector2d error = Distort(*this, n, &jacobian) - distorted;
    if (error.norm() < 1e-12) break;
    // Newton where the model is invertible, the fixed point elsewhere (far outside the image).
    n -= jacobian.determinant() > 0.1 ? Eigen::Vector2d(jacobian.inverse() * error) : error;
  }
  return n;
}

bool Camera::Contains(const Eigen::Vector2d& xy, double border_px) const {
  return xy.x() >= border_px && xy.y() >= border_px && xy.x() <= width_px - 1 - border_px &&
         xy.y() <= height_px - 1 - border_px;
}

Camera Camera::Guess(int width_px, int height_px) {
  Camera camera;
  camera.width_px = width_px;
  camera.height_px = height_px;
  camera.fx = camera.fy = 1.2 * std::max(width_px, height_px);
  camera.cx = (width_px - 1) / 2.0;
  camera.cy = (height_px - 1) / 2.0;
  camera.known = false;
  return camera;
}

}  // namespace cohort
