#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "frontend/geometry/rigid3.h"

namespace cohort {

// A point seen by a camera: the normalised image point n = (X/Z, Y/Z) of its ray
// (Camera::Unproject).
struct Ray {
  Rigid3 cam_from_world;
  Eigen::Vector2d n = Eigen::Vector2d::Zero();
};

// The point with the least algebraic error over all rays (DLT: the right singular vector of the
// rows n_x P_3 - P_1, n_y P_3 - P_2), as a homogeneous vector of norm 1; its last entry is 0 for
// parallel rays. Needs two rays, of cameras near the origin, because it squares their coordinates.
Eigen::Vector4d TriangulateDlt(std::span<const Ray> rays);

// The point with the least squared distance sum |n(X) - n|^2 in the normalised images: DLT, then
// Gauss-Newton. The origin is arbitrary, but the world must have about unit scale. Returns nullopt
// if the rays are parallel or the point is not in front of every camera.
std::optional<Eigen::Vector3d> Triangulate(std::span<const Ray> rays);

// The same for rays with outliers: the hypothesis, out of pairs of rays far apart, that most rays
// agree with to within max_error (in normalised units) is refined on those rays. Returns nullopt if
// fewer than min_rays agree.
struct RobustTriangulation {
  Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
  std::size_t inliers = 0;
};
std::optional<RobustTriangulation> TriangulateRobustly(std::span<const Ray> rays,
                                                       double max_error,
                                                       std::size_t min_rays);

// Distance |n(X) - n| in the normalised image; nullopt behind the camera.
std::optional<double> RayError(const Ray& ray, const Eigen::Vector3d& x_in_world);

// Angle at the point between the rays to two camera centres [rad].
double TriangulationAngle(const Eigen::Vector3d& x_in_world,
                          const Eigen::Vector3d& center_a,
                          const Eigen::Vector3d& center_b);

}  // namespace cohort
