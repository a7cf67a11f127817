#include "backend/geometry/best_rotation.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

namespace cohort {

BestRotation FitRotation(std::span<const std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs) {
  BestRotation result;
  if (pairs.empty()) return result;
  std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> rays;
  rays.reserve(pairs.size());
  for (const auto& [source, target] : pairs) {
    rays.emplace_back(source.homogeneous().normalized(), target.homogeneous().normalized());
  }
  std::vector<double> weights(pairs.size(), 1.0);
  constexpr int kRounds = 6;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix3d B = Eigen::Matrix3d::Zero();
    for (std::size_t i = 0; i < rays.size(); ++i) {
      B.noalias() += weights[i] * rays[i].second * rays[i].first.transpose();
    }
    // The best q = (v, w) is the top eigenvector of [B + B^T - tr B I, z; z^T, tr B].
    const Eigen::Vector3d z(B(2, 1) - B(1, 2), B(0, 2) - B(2, 0), B(1, 0) - B(0, 1));
    Eigen::Matrix4d K;
    K.topLeftCorner<3, 3>() = B + B.transpose() - B.trace() * Eigen::Matrix3d::Identity();
    K.topRightCorner<3, 1>() = z;
    K.bottomLeftCorner<1, 3>() = z.transpose();
    K(3, 3) = B.trace();
    const Eigen::Vector4d q =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d>(K).eigenvectors().col(3);
    result.target_from_source = Eigen::Quaterniond(q[3], q[0], q[1], q[2]);
    const Eigen::Matrix3d R = result.target_from_source.toRotationMatrix();
    for (std::size_t i = 0; i < rays.size(); ++i) {
      weights[i] = 1.0 / std::max((rays[i].second - R * rays[i].first).norm(), 1e-5);
    }
  }
  result.errors.reserve(pairs.size());
  const Eigen::Matrix3d R = result.target_from_source.toRotationMatrix();
  for (const auto& [source, target] : pairs) {
    const Eigen::Vector3d x = R * source.homogeneous();
    result.errors.push_back((x.hnormalized() - target).norm());
  }
  return result;
}

}  // namespace cohort
