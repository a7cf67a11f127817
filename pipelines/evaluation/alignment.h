#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string_view>

#include "frontend/geometry/sim3.h"

namespace cohort {

enum class AlignmentScale { kEstimated, kOne };  // Sim(3), or SE(3)

// How far pairs of points fix their alignment.
enum class AlignmentStatus {
  kUnique,
  // All of one side are on a line: a turn about it changes no distance between the pairs. So their
  // root mean square and the scale are unique; what is not on the line could be anywhere around it.
  kFreeAboutALine,
  kTooFewPoints,  // under 3
  kOnePlace,      // all of one side are in one place, or the sides have no direction in common
};

// For a message: why there is no distance to give. Empty where there is one.
std::string_view Reason(AlignmentStatus status);

struct Alignment {
  AlignmentStatus status = AlignmentStatus::kTooFewPoints;
  Sim3 target_from_source{};  // kFreeAboutALine: one of those that are equally good

  bool FixesDistances() const {
    return status == AlignmentStatus::kUnique || status == AlignmentStatus::kFreeAboutALine;
  }
};

// The target_from_source that minimises sum |target_i - target_from_source * source_i|^2 (Umeyama,
// PAMI 1991; what evo calls `--align --correct_scale`, or `--align` for kOne). Evo refuses
// kFreeAboutALine.
Alignment FitAlignment(std::span<const Eigen::Vector3d> source,
                       std::span<const Eigen::Vector3d> target,
                       AlignmentScale scale);

// The same; none unless it is unique.
std::optional<Sim3> AlignPoints(std::span<const Eigen::Vector3d> source,
                                std::span<const Eigen::Vector3d> target,
                                AlignmentScale scale);

// Root mean square distance of points from their mean.
double Extent(std::span<const Eigen::Vector3d> points);

// Root mean square distance between the two after the alignment by Sim(3), in the target's units;
// none unless the alignment fixes it.
std::optional<double> AlignedRmse(std::span<const Eigen::Vector3d> source,
                                  std::span<const Eigen::Vector3d> target);

}  // namespace cohort
