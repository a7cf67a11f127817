#include "pipelines/evaluation/alignment.h"

#include <Eigen/SVD>
#include <cmath>

#include "frontend/core/error.h"

namespace cohort {

std::optional<Sim3> AlignPoints(std::span<const Eigen::Vector3d> source,
                                std::span<const Eigen::Vector3d> target,
                                AlignmentScale scale) {
  Check(source.size() == target.size(), "points to align come in pairs");
  const std::size_t n = source.size();
  if (n < 3) return std::nullopt;
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
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d& d = svd.singularValues();
  constexpr double kRankTolerance = 1e-12;  // against d[0]: rounding gives 1e-16
  if (!(d[1] > kRankTolerance * d[0])) return std::nullopt;
  const bool mirrored = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0;
  const Eigen::Vector3d signs(1.0, 1.0, mirrored ? -1.0 : 1.0);
  const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  Sim3 target_from_source;
  target_from_source.rotation = Eigen::Quaterniond(rotation).normalized();
  target_from_source.scale =
      scale == AlignmentScale::kEstimated ? d.dot(signs) / source_variance : 1.0;
  target_from_source.translation =
      target_mean - target_from_source.scale * (target_from_source.rotation * source_mean);
  return target_from_source;
}

std::optional<double> AlignedRmse(std::span<const Eigen::Vector3d> source,
                                  std::span<const Eigen::Vector3d> target) {
  const auto target_from_source = AlignPoints(source, target, AlignmentScale::kEstimated);
  if (!target_from_source) return std::nullopt;
  double sum = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i) {
    sum += (*target_from_source * source[i] - target[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(source.size()));
}

}  // namespace cohort
