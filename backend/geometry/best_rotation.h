#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <utility>

namespace cohort {

// The rotation that takes the rays of one image best to those of another, and what it leaves.
struct BestRotation {
  Eigen::Quaterniond target_from_source = Eigen::Quaterniond::Identity();
  double median_error = 0.0;  // of |n_target - n(R ray_source)|, normalised units
};

// Of pairs (source, target) of normalised image points. Wahba's problem, solved by Davenport's
// quaternion matrix and reweighted for least absolute distances, so that a minority of wrong or of
// near points does not matter. Identity and 0 without pairs.
BestRotation FitRotation(std::span<const std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs);

}  // namespace cohort
