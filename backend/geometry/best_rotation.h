#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <utility>
#include <vector>

namespace cohort {

// The rotation that takes the rays of one image best to those of another, and what it leaves.
struct BestRotation {
  Eigen::Quaterniond target_from_source = Eigen::Quaterniond::Identity();
  std::vector<double> errors;  // |n_target - n(R ray_source)| of each pair, normalised units
};

// The best rotation for pairs (source, target) of normalised image points: Wahba's problem, solved
// by Davenport's quaternion matrix and reweighted for least absolute distances, so that a minority
// of wrong or near points does not matter. Identity without pairs.
BestRotation FitRotation(std::span<const std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs);

}  // namespace cohort
