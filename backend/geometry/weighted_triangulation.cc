#include "backend/geometry/weighted_triangulation.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace cohort {
namespace {

// Depth below which a point counts as lying at the camera's centre, as in triangulation.cc.
constexpr double kLeastDepth = 1e-9;

}  // namespace

std::optional<EstimatedPoint> TriangulateWeighted(std::span<const WeightedRay> rays,
                                                  const Eigen::Vector3d& start) {
  constexpr int kMaxIterations = 10;
  constexpr double kSettled = 1e-4;      // of a standard deviation
  constexpr double kLeastShare = 1e-12;  // of the Hessian's eigenvalues: the rays are parallel
  EstimatedPoint point{start, Eigen::Matrix3d::Zero()};
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const auto& [ray, information] : rays) {
      const Eigen::Vector3d x = ray.cam_from_world * point.in_world;
      if (x.z() < kLeastDepth) return std::nullopt;
      const Eigen::Vector2d n = x.hnormalized();
      Eigen::Matrix<double, 2, 3> d_x;
      d_x << 1.0, 0.0, -n.x(), 0.0, 1.0, -n.y();
      const Eigen::Matrix<double, 2, 3> jacobian =
          d_x / x.z() * ray.cam_from_world.rotation.toRotationMatrix();
      const Eigen::Matrix<double, 3, 2> weight = jacobian.transpose() * information;
      hessian.noalias() += weight * jacobian;
      gradient.noalias() += weight * (n - ray.n);
    }
    const Eigen::Vector3d scales =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(hessian, Eigen::EigenvaluesOnly)
            .eigenvalues();
    if (!(scales[0] > kLeastShare * scales[2])) return std::nullopt;
    point.covariance = hessian.inverse();
    const Eigen::Vector3d step = point.covariance * gradient;
    if (!step.allFinite()) return std::nullopt;
    point.in_world -= step;
    if (step.dot(gradient) <= kSettled * kSettled) break;
  }
  for (const auto& [ray, information] : rays) {
    if ((ray.cam_from_world * point.in_world).z() < kLeastDepth) return std::nullopt;
  }
  return point;
}

}  // namespace cohort
