#include "pipelines/evaluation/trajectory_error.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "frontend/core/error.h"

namespace cohort {
namespace {

constexpr double kDegrees = 180.0 / std::numbers::pi;

double AngleDeg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * kDegrees;
}

}  // namespace

std::vector<PosePair> TransformEstimates(const Sim3& truth_from_estimate,
                                         std::span<const PosePair> pairs) {
  std::vector<PosePair> moved(pairs.begin(), pairs.end());
  for (PosePair& pair : moved) {
    pair.estimate.rotation = (truth_from_estimate.rotation * pair.estimate.rotation).normalized();
    pair.estimate.translation = truth_from_estimate * pair.estimate.translation;
  }
  return moved;
}

double Rmse(std::vector<double> errors) {
  Check(!errors.empty(), "a mean is of one error or more");
  std::sort(errors.begin(), errors.end());  // large ones last: less rounding
  double sum = 0.0;
  for (const double e : errors) sum += e * e;
  return std::sqrt(sum / static_cast<double>(errors.size()));
}

std::vector<double> AbsoluteTranslationErrors(std::span<const PosePair> aligned) {
  std::vector<double> errors;
  for (const PosePair& pair : aligned) {
    errors.push_back((pair.estimate.translation - pair.truth.translation).norm());
  }
  return errors;
}

RelativeErrors ComputeRelativeErrors(std::span<const PosePair> aligned) {
  RelativeErrors errors;
  for (std::size_t i = 0; i + 1 < aligned.size(); ++i) {
    const PosePair& a = aligned[i];
    const PosePair& b = aligned[i + 1];
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
