#include "pipelines/evaluation/trajectory_error.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <numbers>
#include <numeric>
#include <utility>

#include "datasets/readers/text_table.h"
#include "frontend/core/error.h"
#include "frontend/core/statistics.h"
#include "frontend/core/time_difference.h"

namespace cohort {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * kDegrees;
}

// Finds the pose nearest in time; the first in the list if several are equally near.
class NearestInTime {
 public:
  explicit NearestInTime(std::span<const StampedPose> poses) {
    for (std::size_t i = 0; i < poses.size(); ++i) by_time_.emplace_back(poses[i].timestamp_ns, i);
    std::sort(by_time_.begin(), by_time_.end());
  }
  // Requires at least one pose.
  std::size_t Find(std::int64_t timestamp_ns) const {
    const auto later = FirstFrom(timestamp_ns);
    if (later == by_time_.begin()) return later->second;
    const auto earlier = FirstFrom(std::prev(later)->first);
    if (later == by_time_.end()) return earlier->second;
    const std::uint64_t before = TimeBetween(earlier->first, timestamp_ns);
    const std::uint64_t behind = TimeBetween(later->first, timestamp_ns);
    if (before != behind) return before < behind ? earlier->second : later->second;
    return std::min(earlier->second, later->second);
  }

 private:
  using TimeAndPlace = std::pair<std::int64_t, std::size_t>;
  std::vector<TimeAndPlace>::const_iterator FirstFrom(std::int64_t timestamp_ns) const {
    return std::lower_bound(
        by_time_.begin(), by_time_.end(), TimeAndPlace(timestamp_ns, std::size_t{0}));
  }

  std::vector<TimeAndPlace> by_time_;
};

}  // namespace

std::vector<StampedPose> ReadTumTrajectory(const std::filesystem::path& path) {
  const TextTable table(path);
  std::vector<StampedPose> poses;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    if (table.columns(row) != 8) table.Fail(row, "a pose has 8 numbers: t tx ty tz qx qy qz qw");
    StampedPose& pose = poses.emplace_back();
    pose.timestamp_ns = table.SecondsAsNs(row, 0);
    const auto number = [&](std::size_t column) { return table.Number(row, column); };
    pose.world_from_cam.translation = {number(1), number(2), number(3)};
    const Eigen::Quaterniond rotation(number(7), number(4), number(5), number(6));
    if (!(rotation.norm() > 0.0 && std::isfinite(rotation.norm()))) {
      table.Fail(row, "the quaternion is invalid");
    }
    pose.world_from_cam.rotation = rotation.normalized();
  }
  return poses;
}

std::vector<PosePair> AssociatePoses(std::span<const StampedPose> estimate,
                                     std::span<const StampedPose> truth,
                                     std::int64_t max_difference_ns) {
  std::vector<PosePair> pairs;
  if (estimate.empty() || truth.empty()) return pairs;
  const bool estimate_is_longer = estimate.size() > truth.size();
  const auto shorter = estimate_is_longer ? truth : estimate;
  const auto longer = estimate_is_longer ? estimate : truth;
  const NearestInTime nearest(longer);
  for (const StampedPose& pose : shorter) {
    const StampedPose& other = longer[nearest.Find(pose.timestamp_ns)];
    if (TimeBetween(other.timestamp_ns, pose.timestamp_ns) >
        static_cast<std::uint64_t>(max_difference_ns)) {
      continue;
    }
    pairs.push_back(estimate_is_longer ? PosePair{other.world_from_cam, pose.world_from_cam}
                                       : PosePair{pose.world_from_cam, other.world_from_cam});
  }
  return pairs;
}

std::vector<PosePair> TransformEstimates(const Sim3& truth_from_estimate,
                                         std::span<const PosePair> pairs) {
  std::vector<PosePair> moved(pairs.begin(), pairs.end());
  for (PosePair& pair : moved) {
    pair.estimate.rotation = (truth_from_estimate.rotation * pair.estimate.rotation).normalized();
    pair.estimate.translation = truth_from_estimate * pair.estimate.translation;
  }
  return moved;
}

std::optional<ErrorStatistics> ComputeStatistics(std::vector<double> errors) {
  if (errors.empty()) return std::nullopt;
  std::sort(errors.begin(), errors.end());
  const std::size_t n = errors.size();
  ErrorStatistics s;
  s.count = n;
  s.min = errors.front();
  s.max = errors.back();
  s.median = InterpolatedMedian(errors);
  s.mean = std::accumulate(errors.begin(), errors.end(), 0.0) / static_cast<double>(n);
  double squared_deviations = 0.0;
  for (const double e : errors) {
    s.sse += e * e;
    squared_deviations += (e - s.mean) * (e - s.mean);
  }
  s.rmse = std::sqrt(s.sse / static_cast<double>(n));
  s.std = std::sqrt(squared_deviations / static_cast<double>(n));
  return s;
}

std::vector<double> AbsoluteTranslationErrors(std::span<const PosePair> aligned) {
  std::vector<double> errors;
  for (const PosePair& pair : aligned) {
    errors.push_back((pair.estimate.translation - pair.truth.translation).norm());
  }
  return errors;
}

std::vector<double> AbsoluteRotationErrorsDeg(std::span<const PosePair> aligned) {
  std::vector<double> errors;
  for (const PosePair& pair : aligned) {
    errors.push_back(AngleBetween(pair.estimate.rotation, pair.truth.rotation) * kDegrees);
  }
  return errors;
}

RelativeErrors ComputeRelativeErrors(std::span<const PosePair> aligned,
                                     std::size_t delta,
                                     RelativePairs pairs) {
  Check(delta > 0, "relative errors span at least one step");
  RelativeErrors errors;
  const std::size_t step = pairs == RelativePairs::kAll ? 1 : delta;
  for (std::size_t i = 0; i + delta < aligned.size(); i += step) {
    const PosePair& a = aligned[i];
    const PosePair& b = aligned[i + delta];
    const Rigid3 true_motion = a.truth.Inverse() * b.truth;
    const Rigid3 estimated_motion = a.estimate.Inverse() * b.estimate;
    const Rigid3 error = true_motion.Inverse() * estimated_motion;
    errors.translation.push_back(error.translation.norm());
    errors.rotation_deg.push_back(AngleBetween(error.rotation, Eigen::Quaterniond::Identity()) *
                                  kDegrees);
  }
  return errors;
}

std::vector<double> RelativePoseErrorsDeg(std::span<const PosePair> pairs, double min_baseline) {
  std::vector<double> errors;
  errors.reserve(pairs.size() * pairs.size() / 2);
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    for (std::size_t j = i + 1; j < pairs.size(); ++j) {
      const Rigid3 estimate = pairs[i].estimate.Inverse() * pairs[j].estimate;
      const Rigid3 truth = pairs[i].truth.Inverse() * pairs[j].truth;
      double error = AngleBetween(estimate.rotation, truth.rotation) * kDegrees;
      if (truth.translation.norm() >= min_baseline && truth.translation.norm() > 0.0) {
        // An estimate without motion has no direction and gets the largest possible error.
        const bool has_direction = estimate.translation.norm() > 0.0;
        error = std::max(error,
                         has_direction ? AngleDeg(estimate.translation, truth.translation) : 180.0);
      }
      errors.push_back(error);
    }
  }
  return errors;
}

double AreaUnderRecall(std::vector<double> errors_deg, double threshold_deg, std::size_t count) {
  Check(count > 0 && count >= errors_deg.size() && threshold_deg > 0.0,
        "recall needs errors and a threshold");
  std::sort(errors_deg.begin(), errors_deg.end());
  const double share = 1.0 / static_cast<double>(count);
  double area = 0.0, recall = 0.0, previous = 0.0;
  for (const double error : errors_deg) {
    if (error >= threshold_deg) break;
    area += (error - previous) * (recall + 0.5 * share);
    recall += share;
    previous = error;
  }
  area += (threshold_deg - previous) * recall;
  return area / threshold_deg;
}

}  // namespace cohort
