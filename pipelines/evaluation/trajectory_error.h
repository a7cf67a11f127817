#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "frontend/geometry/rigid3.h"
#include "frontend/geometry/sim3.h"

namespace cohort {

// The estimated and the true pose of one frame, both world_from_cam.
struct PosePair {
  Rigid3 estimate;
  Rigid3 truth;
};

// Moves the estimates into the truth's world; rotations and positions, not the cameras' own axes.
std::vector<PosePair> TransformEstimates(const Sim3& truth_from_estimate,
                                         std::span<const PosePair> pairs);

// The root of the mean of the squares; of one error or more.
double Rmse(std::vector<double> errors);

// Absolute errors of aligned poses, one per pair: the distance of camera centres [units of the
// truth].
std::vector<double> AbsoluteTranslationErrors(std::span<const PosePair> aligned);

// Relative errors from each pair to the next: E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j) with the truth Q and
// the estimate P, j = i + 1; |translation of E| and the angle of E.
struct RelativeErrors {
  std::vector<double> translation;
  std::vector<double> rotation_deg;
};
RelativeErrors ComputeRelativeErrors(std::span<const PosePair> aligned);

// Errors of relative poses between any two frames, which need no alignment: the larger of the angle
// between the relative rotations and the angle between the directions of the relative translations
// [deg]. If the true cameras are closer than `min_baseline`, their direction counts as right.
std::vector<double> RelativePoseErrorsDeg(std::span<const PosePair> pairs, double min_baseline);

// Area under the curve of recall over error, from 0 to `threshold`, as a share of the whole: 1 is
// perfect. Errors missing from `errors_deg`, out of `count`, are failures. The area under the line
// through the sorted errors is exact (SuperGlue, COLMAP's benchmark).
double AreaUnderRecall(std::vector<double> errors_deg, double threshold_deg, std::size_t count);

}  // namespace cohort
