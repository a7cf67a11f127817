#include "backend/geometry/triangulation.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

namespace cohort {
namespace {

// Depth below which a point counts as lying at the camera's centre; scenes are scaled to about 1.
constexpr double kMinRayDepth = 1e-9;

// Gauss-Newton on sum |n(X) - n|^2. Returns nullopt if a step leaves the space in front of a
// camera.
std::optional<Eigen::Vector3d> Refine(std::span<const Ray> rays, Eigen::Vector3d x_in_world) {
  constexpr int kMaxIterations = 10;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
    for (const Ray& ray : rays) {
      const Eigen::Vector3d x = ray.cam_from_world * x_in_world;
      if (x.z() < kMinRayDepth) return std::nullopt;
      const Eigen::Matrix3d rotation = ray.cam_from_world.rotation.toRotationMatrix();
      const double inverse_depth = 1.0 / x.z();
      const Eigen::Vector2d n = x.head<2>() * inverse_depth;
      Eigen::Matrix<double, 2, 3> jacobian;
      jacobian.row(0) = (rotation.row(0) - n.x() * rotation.row(2)) * inverse_depth;
      jacobian.row(1) = (rotation.row(1) - n.y() * rotation.row(2)) * inverse_depth;
      hessian.noalias() += jacobian.transpose() * jacobian;
      gradient.noalias() += jacobian.transpose() * (n - ray.n);
    }
    const Eigen::Vector3d step = hessian.ldlt().solve(gradient);
    if (!step.allFinite()) return std::nullopt;
    x_in_world -= step;
    if (step.norm() <= 1e-10 * x_in_world.norm()) break;
  }
  for (const Ray& ray : rays) {
    if ((ray.cam_from_world * x_in_world).z() < kMinRayDepth) return std::nullopt;
  }
  return x_in_world;
}

// A camera's centre if the origin is so far from all cameras that the squares of coordinates have
// no digits left for the distances between them; else the origin.
Eigen::Vector3d OriginNear(std::span<const Ray> rays) {
  constexpr double kFarOff = 1e4;  // in baselines; below this, Gauss-Newton recovers the digits
  const Eigen::Vector3d first = rays.front().cam_from_world.Inverse().translation;
  double baseline = 0.0;
  for (const Ray& ray : rays) {
    baseline = std::max(baseline, (ray.cam_from_world.Inverse().translation - first).norm());
  }
  return first.norm() > kFarOff * baseline ? first : Eigen::Vector3d::Zero();
}

std::optional<Eigen::Vector3d> TriangulateNear(std::span<const Ray> rays) {
  const Eigen::Vector4d x = TriangulateDlt(rays);
  if (std::abs(x.w()) < 1e-12) return std::nullopt;
  return Refine(rays, x.head<3>() / x.w());
}

}  // namespace

Eigen::Vector4d TriangulateDlt(std::span<const Ray> rays) {
  Eigen::Matrix4d gram = Eigen::Matrix4d::Zero();
  for (const Ray& ray : rays) {
    Eigen::Matrix<double, 3, 4> projection;
    projection << ray.cam_from_world.rotation.toRotationMatrix(), ray.cam_from_world.translation;
    // Gives the row the norm that it has for the unit ray.
    const double weight = 1.0 / (1.0 + ray.n.squaredNorm());
    for (int i = 0; i < 2; ++i) {
      const Eigen::RowVector4d row = ray.n[i] * projection.row(2) - projection.row(i);
      gram.noalias() += weight * row.transpose() * row;
    }
  }
  return Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(gram).eigenvectors().col(0);
}

std::optional<Eigen::Vector3d> Triangulate(std::span<const Ray> rays) {
  if (rays.size() < 2) return std::nullopt;
  const Eigen::Vector3d origin = OriginNear(rays);
  if (origin.isZero(0.0)) return TriangulateNear(rays);
  std::vector<Ray> moved(rays.begin(), rays.end());
  for (Ray& ray : moved) ray.cam_from_world.translation += ray.cam_from_world.rotation * origin;
  const std::optional<Eigen::Vector3d> x = TriangulateNear(moved);
  if (!x) return std::nullopt;
  return *x + origin;
}

std::optional<RobustTriangulation> TriangulateRobustly(std::span<const Ray> rays,
                                                       double max_error,
                                                       std::size_t min_rays) {
  const std::size_t n = rays.size();
  if (n < 2 || n < min_rays) return std::nullopt;
  const auto agrees = [&](const Ray& ray, const Eigen::Vector3d& x) {
    const std::optional<double> error = RayError(ray, x);
    return error && *error <= max_error;
  };
  const auto agreeing = [&](const Eigen::Vector3d& x) {
    std::vector<Ray> result;
    for (const Ray& ray : rays) {
      if (agrees(ray, x)) result.push_back(ray);
    }
    return result;
  };

  std::vector<Ray> best;
  if (const auto x = Triangulate(rays)) best = agreeing(*x);  // all rays: the usual case
  if (best.size() < n) {
    // Pairs half and a quarter of the track apart: wide enough, and enough of them that one is
    // free of outliers.
    const std::size_t step = std::max<std::size_t>(1, n / 8);
    for (const std::size_t gap : {n - 1, n / 2, n / 4}) {
      if (gap == 0) continue;
      for (std::size_t i = 0; i + gap < n; i += step) {
        const std::array pair{rays[i], rays[i + gap]};
        const auto x = Triangulate(pair);
        if (!x) continue;
        std::vector<Ray> candidate = agreeing(*x);
        if (candidate.size() > best.size()) best = std::move(candidate);
      }
    }
  }
  if (best.size() < std::max<std::size_t>(2, min_rays)) return std::nullopt;
  auto refined = Triangulate(best);
  if (!refined) return std::nullopt;
  std::vector<Ray> kept = agreeing(*refined);
  if (kept.size() > best.size()) {
    if (const auto again = Triangulate(kept)) refined = again;
    kept = agreeing(*refined);
  }
  if (kept.size() < std::max<std::size_t>(2, min_rays)) return std::nullopt;
  return RobustTriangulation{*refined, kept.size()};
}

std::optional<double> RayError(const Ray& ray, const Eigen::Vector3d& x_in_world) {
  const Eigen::Vector3d x = ray.cam_from_world * x_in_world;
  if (x.z() < kMinRayDepth) return std::nullopt;
  return (x.hnormalized() - ray.n).norm();
}

double TriangulationAngle(const Eigen::Vector3d& x_in_world,
                          const Eigen::Vector3d& center_a,
                          const Eigen::Vector3d& center_b) {
  const Eigen::Vector3d a = x_in_world - center_a;
  const Eigen::Vector3d b = x_in_world - center_b;
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

}  // namespace cohort
