#pragma once

#include <ceres/crs_matrix.h>

#include <optional>
#include <vector>

#include "backend/adjust/bundle_adjustment.h"

namespace cohort {

// The parameters of a Jacobian's columns: three each of `points`, then six each of `cameras`, then
// one each of `intrinsics` (indices into IntrinsicVector).
struct JacobianColumns {
  std::vector<int> points;
  std::vector<int> cameras;
  std::vector<int> intrinsics;
};

// Blocks of the inverse of the normal equations J'J = [V W'; W U], by the Schur complement of the
// points, S = U - sum W V^-1 W': S^-1 for the cameras, V^-1 + V^-1 W' S^-1 W V^-1 for a point.
// Cameras and points without columns have 0. Returns nullopt if the problem is rank deficient.
std::optional<BundleCovariances> CovariancesFromJacobian(const ceres::CRSMatrix& jacobian,
                                                         const JacobianColumns& columns,
                                                         std::size_t camera_count,
                                                         std::size_t point_count);

}  // namespace cohort
