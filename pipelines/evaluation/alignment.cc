#include "pipelines/evaluation/alignment.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "frontend/core/error.h"

namespace cohort {

namespace {

// Relative to the largest value of its kind; rounding gives 1e-16.
constexpr double kTolerance = 1e-12;

// Root mean square distance from `mean`; 0 if it is only rounding.
double Spread(std::span<const Eigen::Vector3d> points, const Eigen::Vector3d& mean) {
  double variance = 0.0;
  double largest = 0.0;
  for (const Eigen::Vector3d& point : points) {
    variance += (point - mean).squaredNorm() / static_cast<double>(points.size());
    largest = std::max(largest, point.norm());
  }
  const double spread = std::sqrt(variance);
  return spread > kTolerance * largest ? spread : 0.0;
}

}  // namespace

std::string_view Reason(AlignmentStatus status) {
  switch (status) {
    case AlignmentStatus::kUnique:
    case AlignmentStatus::kFreeAboutALine:
      return "";
    case AlignmentStatus::kTooFewPoints:
      return "fewer than 3 cameras have a true pose";
    case AlignmentStatus::kOnePlace:
      return "all cameras, or all true ones, are at one position";
  }
  return "";
}

Alignment FitAlignment(std::span<const Eigen::Vector3d> source,
                       std::span<const Eigen::Vector3d> target,
                       AlignmentScale scale) {
  Check(source.size() == target.size(), "points to align come in pairs");
  const std::size_t n = source.size();
  if (n < 3) return {.status = AlignmentStatus::kTooFewPoints};
  Eigen::Vector3d source_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d target_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    source_mean += source[i] / static_cast<double>(n);
    target_mean += target[i] / static_cast<double>(n);
  }
  double source_variance = 0.0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector3d x = source[i] - source_mean;
    source_variance += x.squaredNorm() / static_cast<double>(n);
    covariance += (target[i] - target_mean) * x.transpose() / static_cast<double>(n);
  }
  const double source_spread = Spread(source, source_mean);
  const double target_spread = Spread(target, target_mean);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& d = svd.singularValues();
  const double most = source_spread * target_spread;  // the largest possible d[0]
  if (most == 0.0 || !(d[0] > kTolerance * most)) return {.status = AlignmentStatus::kOnePlace};
  Alignment alignment;
  alignment.status =
      d[1] > kTolerance * d[0] ? AlignmentStatus::kUnique : AlignmentStatus::kFreeAboutALine;
  const bool mirrored = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0;
  const Eigen::Vector3d signs(1.0, 1.0, mirrored ? -1.0 : 1.0);
  const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  Sim3& target_from_source = alignment.target_from_source;
  target_from_source.rotation = Eigen::Quaterniond(rotation).normalized();
  target_from_source.scale =
      scale == AlignmentScale::kEstimated ? d.dot(signs) / source_variance : 1.0;
  target_from_source.translation =
      target_mean - target_from_source.scale * (target_from_source.rotation * source_mean);
  return alignment;
}

std::optional<Sim3> AlignPoints(std::span<const Eigen::Vector3d> source,
                                std::span<const Eigen::Vector3d> target,
                                AlignmentScale scale) {
  const Alignment alignment = FitAlignment(source, target, scale);
  if (alignment.status != AlignmentStatus::kUnique) return std::nullopt;
  return alignment.target_from_source;
}

double Extent(std::span<const Eigen::Vector3d> points) {
  const auto n = static_cast<double>(points.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point / n;
  double variance = 0.0;
  for (const Eigen::Vector3d& point : points) variance += (point - mean).squaredNorm() / n;
  return std::sqrt(variance);
}

std::optional<double> AlignedRmse(std::span<const Eigen::Vector3d> source,
                                  std::span<const Eigen::Vector3d> target) {
  const Alignment alignment = FitAlignment(source, target, AlignmentScale::kEstimated);
  if (!alignment.FixesDistances()) return std::nullopt;
  double sum = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    sum += (alignment.target_from_source * source[i] - target[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(source.size()));
}

}  // namespace cohort
