#include "backend/adjust/bundle_covariances.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <utility>

#include "frontend/core/interruption.h"

namespace cohort {
namespace {

struct PointBlock {
  Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
  std::map<int, Eigen::Vector3d> W;  // by column of U
};

struct JointEquations {
  std::vector<PointBlock> points;
  Eigen::MatrixXd U;
};

JointEquations AccumulateNormalEquations(const ceres::CRSMatrix& jacobian, std::size_t points) {
  const int first_camera = 3 * static_cast<int>(points);
  const int others = jacobian.num_cols - first_camera;
  JointEquations equations{std::vector<PointBlock>(points), Eigen::MatrixXd::Zero(others, others)};
  for (int row = 0; row < jacobian.num_rows; ++row) {
    int point = -1;
    Eigen::Vector3d d_point = Eigen::Vector3d::Zero();
    std::vector<std::pair<int, double>> d_others;
    for (int k = jacobian.rows[row]; k < jacobian.rows[row + 1]; ++k) {
      const int col = jacobian.cols[k];
      if (col < first_camera) {
        point = col / 3;
        d_point[col % 3] = jacobian.values[k];
      } else {
        d_others.emplace_back(col - first_camera, jacobian.values[k]);
      }
    }
    for (const auto& [i, d_i] : d_others) {
      for (const auto& [j, d_j] : d_others) equations.U(i, j) += d_i * d_j;
      if (point < 0) continue;
      const auto at = equations.points[point].W.try_emplace(i, Eigen::Vector3d::Zero()).first;
      at->second += d_i * d_point;
    }
    if (point >= 0) equations.points[point].V += d_point * d_point.transpose();
  }
  return equations;
}

// The columns of W' that are not 0, and the columns of U that they belong to.
std::pair<std::vector<int>, Eigen::Matrix3Xd> DenseColumns(const PointBlock& block) {
  std::pair<std::vector<int>, Eigen::Matrix3Xd> result{
      {}, Eigen::Matrix3Xd(3, static_cast<Eigen::Index>(block.W.size()))};
  for (const auto& [column, w] : block.W) {
    result.second.col(static_cast<Eigen::Index>(result.first.size())) = w;
    result.first.push_back(column);
  }
  return result;
}

std::optional<Eigen::MatrixXd> InvertSchurComplement(const JointEquations& equations) {
  Eigen::MatrixXd S = equations.U;
  for (const PointBlock& block : equations.points) {
    CheckInterruption();
    const Eigen::LLT<Eigen::Matrix3d> V(block.V);
    if (V.info() != Eigen::Success) return std::nullopt;
    const auto [columns, W] = DenseColumns(block);
    S(columns, columns) -= W.transpose() * V.solve(W);
  }
  const Eigen::LLT<Eigen::MatrixXd> cholesky(S);
  if (cholesky.info() != Eigen::Success) return std::nullopt;
  S = Eigen::MatrixXd::Identity(S.rows(), S.cols());
  // In blocks, with checks for interruption, since all columns of a long clip take a minute.
  constexpr Eigen::Index kColumns = 64;
  for (Eigen::Index first = 0; first < S.cols(); first += kColumns) {
    CheckInterruption();
    auto columns = S.middleCols(first, std::min(kColumns, S.cols() - first));
    cholesky.solveInPlace(columns);
  }
  if (!S.allFinite()) return std::nullopt;
  return S;
}

}  // namespace

std::optional<BundleCovariances> CovariancesFromJacobian(const ceres::CRSMatrix& jacobian,
                                                         const JacobianColumns& columns,
                                                         std::size_t camera_count,
                                                         std::size_t point_count) {
  const JointEquations equations = AccumulateNormalEquations(jacobian, columns.points.size());
  const std::optional<Eigen::MatrixXd> S_inverse = InvertSchurComplement(equations);
  if (!S_inverse) return std::nullopt;

  BundleCovariances result;
  result.cameras.resize(camera_count, Eigen::Matrix<double, 6, 6>::Zero());
  result.points.resize(point_count, Eigen::Matrix3d::Zero());
  result.intrinsics.setZero();
  result.centers = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(3 * camera_count),
                                         static_cast<Eigen::Index>(3 * camera_count));
  for (std::size_t i = 0; i < columns.cameras.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(6 * i);
    result.cameras[columns.cameras[i]] = S_inverse->block<6, 6>(at, at);
    for (std::size_t j = 0; j < columns.cameras.size(); ++j) {
      result.centers.block<3, 3>(3 * columns.cameras[i], 3 * columns.cameras[j]) =
          S_inverse->block<3, 3>(at + 3, static_cast<Eigen::Index>(6 * j + 3));
    }
  }
  for (std::size_t i = 0; i < columns.points.size(); ++i) {
    CheckInterruption();
    const auto [others, W] = DenseColumns(equations.points[i]);
    const Eigen::Matrix3d inverse = equations.points[i].V.inverse();
    const Eigen::Matrix3Xd gain = inverse * W;
    result.points[columns.points[i]] =
        inverse + gain * (*S_inverse)(others, others) * gain.transpose();
  }
  const auto at = static_cast<Eigen::Index>(6 * columns.cameras.size());
  for (std::size_t i = 0; i < columns.intrinsics.size(); ++i) {
    for (std::size_t j = 0; j < columns.intrinsics.size(); ++j) {
      result.intrinsics(columns.intrinsics[i], columns.intrinsics[j]) =
          (*S_inverse)(at + static_cast<Eigen::Index>(i), at + static_cast<Eigen::Index>(j));
    }
  }
  return result;
}

}  // namespace cohort
