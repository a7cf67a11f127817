#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "backend/geometry/triangulation.h"

namespace cohort {

// A ray whose image point n has the information matrix (inverse covariance) W.
struct WeightedRay {
  Ray ray;
  Eigen::Matrix2d information = Eigen::Matrix2d::Identity();
};

struct EstimatedPoint {
  Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
};

// The point with the least sum (n(X) - n)^T W (n(X) - n), by Gauss-Newton from `start`, and its
// covariance (sum J^T W J)^-1 for exact cameras, with J the derivative of n(X) with respect to X.
// Returns nullopt if the rays do not determine a point or it is not in front of every camera.
std::optional<EstimatedPoint> TriangulateWeighted(std::span<const WeightedRay> rays,
                                                  const Eigen::Vector3d& start);

}  // namespace cohort
