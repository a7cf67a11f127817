#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "frontend/geometry/sim3.h"

namespace cohort {

enum class AlignmentScale { kEstimated, kOne };  // Sim(3), or SE(3)

// The target_from_source that minimises sum |target_i - target_from_source * source_i|^2 (Umeyama,
// PAMI 1991; what evo calls `--align --correct_scale`, or `--align` for kOne). None where the
// points do not fix it: fewer than 3, or all of one side on a line (the covariance has rank < 2).
std::optional<Sim3> AlignPoints(std::span<const Eigen::Vector3d> source,
                                std::span<const Eigen::Vector3d> target,
                                AlignmentScale scale);

// Root mean square distance between the two after the alignment by Sim(3), in the target's units.
std::optional<double> AlignedRmse(std::span<const Eigen::Vector3d> source,
                                  std::span<const Eigen::Vector3d> target);

}  // namespace cohort
