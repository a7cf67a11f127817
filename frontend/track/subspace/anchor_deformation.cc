#include "frontend/track/subspace/anchor_deformation.h"

#include <algorithm>

namespace cohort {

Eigen::Matrix2d CommonSimilarity(const Eigen::Matrix2Xd& before,
                                 const Eigen::Matrix2Xd& now,
                                 std::span<const MeasuredFeature> features) {
  constexpr int kPasses = 4;
  constexpr double kLeastFeatures = 4.0;
  constexpr double kLeastDistancePx = 0.3;  // nearer ones weigh the same
  const auto F = static_cast<Eigen::Index>(features.size());
  const auto confirmed = [&](Eigen::Index f) {
    return features[static_cast<std::size_t>(f)].confirmed;
  };
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(F);
  for (Eigen::Index f = 0; f < F; ++f) weights[f] = confirmed(f) ? 1.0 : 0.0;
  double a = 1.0;  // s cos
  double b = 0.0;  // s sin
  for (int pass = 0; pass < kPasses && weights.sum() >= kLeastFeatures; ++pass) {
    const Eigen::Vector2d mean_before = before * weights / weights.sum();
    const Eigen::Vector2d mean_now = now * weights / weights.sum();
    double dot = 0.0;
    double cross = 0.0;
    double square = 0.0;
    for (Eigen::Index f = 0; f < F; ++f) {
      const Eigen::Vector2d p = before.col(f) - mean_before;
      const Eigen::Vector2d q = now.col(f) - mean_now;
      dot += weights[f] * p.dot(q);
      cross += weights[f] * (p.x() * q.y() - p.y() * q.x());
      square += weights[f] * p.squaredNorm();
    }
    if (!(square > 0.0)) break;
    a = dot / square;
    b = cross / square;
    for (Eigen::Index f = 0; f < F; ++f) {  // towards least absolute distances
      const Eigen::Vector2d p = before.col(f) - mean_before;
      const Eigen::Vector2d q = now.col(f) - mean_now;
      const double distance =
          (q - Eigen::Vector2d(a * p.x() - b * p.y(), b * p.x() + a * p.y())).norm();
      weights[f] = confirmed(f) ? 1.0 / std::max(distance, kLeastDistancePx) : 0.0;
    }
  }
  Eigen::Matrix2d similarity;
  similarity << a, -b, b, a;
  return similarity;
}

void DeformAnchors(const Eigen::Matrix2d& similarity,
                   double warp_noise,
                   std::span<MeasuredFeature> features) {
  const double noise = warp_noise * warp_noise;
  for (MeasuredFeature& feature : features) {
    feature.anchor.warp = similarity * feature.anchor.warp;
    feature.anchor.warp_covariance.diagonal().array() += noise;
  }
}

}  // namespace cohort
