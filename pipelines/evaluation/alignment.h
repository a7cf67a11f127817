#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string_view>

#include "frontend/geometry/sim3.h"

namespace cohort {

enum class AlignmentScale { kEstimated, kOne };  // Sim(3), or SE(3)

// How well pairs of points determine their alignment.
enum class AlignmentStatus {
  kUnique,
  // All points of one side are on a line: a rotation about it changes no distance between the
  // pairs. Their root mean square and the scale are unique, but points off the line can be anywhere
  // around it.
  kFreeAboutALine,
  kTooFewPoints,  // under 3
  kOnePlace,      // all of one side coincide, or the sides have no direction in common
};

// The reason for a message if there is no distance; else empty.
std::string_view Reason(AlignmentStatus status);

struct Alignment {
  AlignmentStatus status = AlignmentStatus::kTooFewPoints;
  Sim3 target_from_source{};  // kFreeAboutALine: one of the equally good ones

  bool FixesDistances() const {
    return status == AlignmentStatus::kUnique || status == AlignmentStatus::kFreeAboutALine;
  }
};

// The target_from_source that minimises sum |target_i - target_from_source * source_i|^2 (Umeyama,
// PAMI 1991; evo's `--align --correct_scale`, or `--align` for kOne). Evo rejects kFreeAboutALine.
Alignment FitAlignment(std::span<const Eigen::Vector3d> source,
                       std::span<const Eigen::Vector3d> target,
                       AlignmentScale scale);

// The same; nullopt unless it is unique.
std::optional<Sim3> AlignPoints(std::span<const Eigen::Vector3d> source,
                                std::span<const Eigen::Vector3d> target,
                                AlignmentScale scale);

// Root mean square distance of points from their mean.
double Extent(std::span<const Eigen::Vector3d> points);

// Root mean square distance between both after the alignment by Sim(3), in the target's units;
// nullopt unless the alignment determines it.
std::optional<double> AlignedRmse(std::span<const Eigen::Vector3d> source,
                                  std::span<const Eigen::Vector3d> target);

}  // namespace cohort
