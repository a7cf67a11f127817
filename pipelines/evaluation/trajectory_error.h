#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "frontend/geometry/rigid3.h"
#include "frontend/geometry/sim3.h"

namespace cohort {

struct StampedPose {
  std::int64_t timestamp_ns = 0;
  Rigid3 world_from_cam;
};

// TUM format: one pose per line, `t tx ty tz qx qy qz qw`, t in seconds, world_from_cam. Throws
// Error naming file and line.
std::vector<StampedPose> ReadTumTrajectory(const std::filesystem::path& path);

// The estimated and the true pose of one frame, both world_from_cam.
struct PosePair {
  Rigid3 estimate;
  Rigid3 truth;
};

// Associates like evo: each pose of the shorter trajectory (the estimate, if they are equally long)
// with the nearest stamp of the longer one, if that is within max_difference_ns.
std::vector<PosePair> AssociatePoses(std::span<const StampedPose> estimate,
                                     std::span<const StampedPose> truth,
                                     std::int64_t max_difference_ns = 10'000'000);

// Moves the estimates into the truth's world; rotations and positions, not the cameras' own axes.
std::vector<PosePair> TransformEstimates(const Sim3& truth_from_estimate,
                                         std::span<const PosePair> pairs);

struct ErrorStatistics {
  std::size_t count = 0;
  double rmse = 0.0;
  double mean = 0.0;
  double median = 0.0;  // of an even number: the mean of the two in the middle
  double std = 0.0;     // of the population (divided by count)
  double min = 0.0;
  double max = 0.0;
  double sse = 0.0;  // sum of squares
};

// Returns nullopt without errors.
std::optional<ErrorStatistics> ComputeStatistics(std::vector<double> errors);

// Absolute errors of aligned poses, one per pair: the distance of camera centres [units of the
// truth], and the angle of estimate^-1 * truth.
std::vector<double> AbsoluteTranslationErrors(std::span<const PosePair> aligned);
std::vector<double> AbsoluteRotationErrorsDeg(std::span<const PosePair> aligned);

enum class RelativePairs {
  kConsecutive,  // (0, d), (d, 2d) ..., without overlap
  kAll,          // (i, i + d) for every i
};

// Relative errors over `delta` pairs: E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j) with the truth Q and the
// estimate P; |translation of E| and the angle of E.
struct RelativeErrors {
  std::vector<double> translation;
  std::vector<double> rotation_deg;
};
RelativeErrors ComputeRelativeErrors(std::span<const PosePair> aligned,
                                     std::size_t delta,
                                     RelativePairs pairs);

// Errors of relative poses between any two frames, which need no alignment: the larger of the angle
// between the relative rotations and the angle between the directions of the relative translations
// [deg]. If the true cameras are closer than `min_baseline`, their direction counts as right.
std::vector<double> RelativePoseErrorsDeg(std::span<const PosePair> pairs, double min_baseline);

// Area under the curve of recall over error, from 0 to `threshold`, as a share of the whole: 1 is
// perfect. Errors missing from `errors_deg`, out of `count`, are failures. The area under the line
// through the sorted errors is exact (SuperGlue, COLMAP's benchmark).
double AreaUnderRecall(std::vector<double> errors_deg, double threshold_deg, std::size_t count);

}  // namespace cohort
