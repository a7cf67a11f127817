#include "frontend/track/subspace/optimizer.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include "frontend/core/in_parallel.h"
#include "frontend/core/statistics.h"
#include "frontend/energy/patch_energy.h"
#include "frontend/track/subspace/line_search.h"

namespace cohort {
namespace {

// No step of a line search moves a feature further than this [px of the level].
constexpr double kMaxStepPx = 3.0;

double LargestColumnNorm(const Eigen::Matrix2Xd& c) {
  return c.cols() == 0 ? 0.0 : c.colwise().norm().maxCoeff();
}

}  // namespace

OptimizerResult MinimizeAlgorithm1(const TotalEnergy& energy,
                                   Eigen::Matrix2Xd x,
                                   int min_iterations,
                                   int max_iterations) {
  OptimizerResult result;
  result.energy = energy.Value(x);
  double old_norm = std::numeric_limits<double>::infinity();
  double step_px = 0.5;  // where the next line search begins
  for (int i = 1; i <= max_iterations; ++i) {
    const Eigen::Matrix2Xd a = -energy.Gradient(x);
    Eigen::Matrix2Xd b = a;
    for (Eigen::Index f = 0; f < b.cols(); ++f) {
      const double norm = b.col(f).norm();
      if (norm > 0.0) b.col(f) /= norm;
    }
    const Eigen::Matrix2Xd c = 0.5 * a + 0.5 * b;
    const double reach = LargestColumnNorm(c);
    if (reach == 0.0) break;
    const LineSearchResult step =
        NearestMinimum(energy.Along(x, c), result.energy, step_px / reach, kMaxStepPx / reach);
    result.evaluations += step.evaluations;
    ++result.iterations;
    x += step.d * c;
    result.energy = step.value;
    step_px = std::clamp(step.d * reach, 0.01, 1.0);
    const double norm = a.norm();
    if ((norm > 0.99 * old_norm && i > min_iterations) || step.d == 0.0) break;
    old_norm = norm;
  }
  result.x = std::move(x);
  return result;
}

OptimizerResult MinimizeSeparately(const TotalEnergy& energy,
                                   Eigen::Matrix2Xd x,
                                   int max_iterations) {
  OptimizerResult result;
  const int n = energy.patch_side();
  for (Eigen::Index f = 0; f < x.cols(); ++f) {
    const auto patch = energy.patch(f);
    Eigen::Vector2d xf = x.col(f);
    double step_px = 0.5;
    for (int i = 0; i < max_iterations; ++i) {
      const PatchGradient at = PatchEnergyGradient(energy.picture(), xf, patch, n);
      const double norm = at.gradient.norm();
      if (norm == 0.0) break;
      const Eigen::Vector2d direction = -at.gradient / norm;
      const auto along = [&](double d) {
        return PatchEnergy(energy.picture(), xf + d * direction, patch, n);
      };
      const LineSearchResult step = NearestMinimum(along, at.energy, step_px, kMaxStepPx);
      result.evaluations += step.evaluations;
      xf += step.d * direction;
      step_px = std::clamp(step.d, 0.02, 1.0);
      if (step.d < 0.01) break;
    }
    x.col(f) = xf;
    result.iterations += 1;
  }
  result.energy = energy.Value(x);
  result.x = std::move(x);
  return result;
}

namespace {

// Coordinates of the features in the leading directions of the history, r x F: the ones row (a
// common shift costs nothing when M is centred, and next to nothing when it is not), then right
// singular vectors of B.
Eigen::MatrixXd LeadingCoordinates(const TrajectoryMatrix& trajectories, int rank) {
  const Eigen::MatrixXd& B = trajectories.history();
  const Eigen::Index F = B.cols();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(B * B.transpose());
  const Eigen::VectorXd& lambda = eigen.eigenvalues();
  std::vector<Eigen::VectorXd> rows;
  rows.push_back(Eigen::VectorXd::Constant(F, 1.0 / std::sqrt(static_cast<double>(F))));
  for (int k = 0; k < rank && k < lambda.size(); ++k) {
    const Eigen::Index i = lambda.size() - 1 - k;
    if (lambda[i] <= 1e-12 * lambda[lambda.size() - 1]) break;
    rows.emplace_back(B.transpose() * eigen.eigenvectors().col(i) / std::sqrt(lambda[i]));
  }
  Eigen::MatrixXd V(static_cast<Eigen::Index>(rows.size()), F);
  for (std::size_t k = 0; k < rows.size(); ++k) V.row(static_cast<Eigen::Index>(k)) = rows[k];
  return V;
}

// C at x, and what a Newton step from there needs.
struct Expansion {
  double value = 0.0;
  Eigen::Matrix2Xd gradient;              // of C, 2 x F
  std::vector<Eigen::Matrix2d> hessians;  // a_f J_f, the data term's
  Eigen::Matrix2d K;                      // see JointStep
};

Expansion ExpansionAt(const TotalEnergy& energy, const Eigen::Matrix2Xd& x) {
  constexpr double kLeastResidual = 0.01;
  const TrajectoryMatrix& trajectories = *energy.trajectories();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(trajectories.Gram(x));
  const Eigen::MatrixXd& U = eigen.eigenvectors();
  const Eigen::VectorXd h = energy.penalty()->Weights(eigen.eigenvalues());
  const Eigen::MatrixXd top = U.topRows(2);
  Expansion at;
  at.value = energy.penalty()->Value(eigen.eigenvalues());
  at.gradient = trajectories.TopRowsOfProduct(top * h.asDiagonal() * U.transpose(), x);
  at.K = top * h.cwiseMax(0.0).asDiagonal() * top.transpose();
  at.K += (1e-6 * at.K.trace() + 1e-300) * Eigen::Matrix2d::Identity();

  const auto F = static_cast<std::size_t>(x.cols());
  std::vector<double> values(F, 0.0);
  at.hessians.assign(F, Eigen::Matrix2d::Zero());
  ForEachInParallel(F, [&](std::size_t i) {
    const auto f = static_cast<Eigen::Index>(i);
    const double weight = energy.data_weights()[f];
    if (weight == 0.0) return;
    const PatchQuadratic q = PatchEnergyQuadratic(
        energy.picture(), x.col(f), energy.patch(f), energy.patch_side(), kLeastResidual);
    values[i] = weight * q.energy;
    at.gradient.col(f) += weight * q.gradient;
    at.hessians[i] = weight * q.hessian;
  });
  for (const double value : values) at.value += value;
  return at;
}

// One Newton step of all features together (optimizer.h), 2 x F: K, J_f, A and v_f are named there,
// V's columns are the v_f. Eliminating s_f = D_f^-1 (K A v_f - g_f), D_f = J_f + K, leaves
//   sum_f (K - K D_f^-1 K) A v_f v_f' = -sum_f K D_f^-1 g_f v_f'.
Eigen::Matrix2Xd JointStep(const Expansion& at, const Eigen::MatrixXd& V) {
  const Eigen::Index F = V.cols();
  const Eigen::Index r = V.rows();
  const Eigen::Matrix2d& K = at.K;
  std::vector<Eigen::Matrix2d> D_inverse(static_cast<std::size_t>(F));
  // Of the blocks (p, q), q <= p, the entries (0, 0), (0, 1), (1, 1).
  Eigen::Matrix3Xd sums = Eigen::Matrix3Xd::Zero(3, r * (r + 1) / 2);
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(2 * r);
  for (Eigen::Index f = 0; f < F; ++f) {
    const Eigen::Matrix2d D = at.hessians[static_cast<std::size_t>(f)] + K;
    const Eigen::Matrix2d inverse = D.inverse();
    const Eigen::Matrix2d KD = K * inverse;
    const Eigen::Matrix2d schur = K - KD * K;
    const Eigen::Vector3d entries(schur(0, 0), 0.5 * (schur(0, 1) + schur(1, 0)), schur(1, 1));
    const Eigen::Vector2d b = -KD * at.gradient.col(f);
    Eigen::Index block = 0;
    for (Eigen::Index p = 0; p < r; ++p) {
      rhs.segment<2>(2 * p) += V(p, f) * b;
      for (Eigen::Index q = 0; q <= p; ++q) sums.col(block++) += V(p, f) * V(q, f) * entries;
    }
    D_inverse[static_cast<std::size_t>(f)] = inverse;
  }
  Eigen::MatrixXd S(2 * r, 2 * r);
  for (Eigen::Index p = 0, block = 0; p < r; ++p) {
    for (Eigen::Index q = 0; q <= p; ++q, ++block) {
      Eigen::Matrix2d entries;
      entries << sums(0, block), sums(1, block), sums(1, block), sums(2, block);
      S.block<2, 2>(2 * p, 2 * q) = entries;
      S.block<2, 2>(2 * q, 2 * p) = entries;
    }
  }
  S.diagonal().array() += 1e-9 * S.trace() + 1e-300;
  const Eigen::VectorXd A = S.ldlt().solve(rhs);
  Eigen::Matrix2Xd step(2, F);
  for (Eigen::Index f = 0; f < F; ++f) {
    Eigen::Vector2d Av = Eigen::Vector2d::Zero();
    for (Eigen::Index p = 0; p < r; ++p) Av += V(p, f) * A.segment<2>(2 * p);
    step.col(f) = D_inverse[static_cast<std::size_t>(f)] * (K * Av - at.gradient.col(f));
  }
  return step;
}

}  // namespace

OptimizerResult MinimizeJointly(
    const TotalEnergy& energy, Eigen::Matrix2Xd x, int rank, int max_iterations, double rest_px) {
  Check(energy.penalty() != nullptr, "MinimizeJointly needs a penalty");
  const Eigen::MatrixXd V = LeadingCoordinates(*energy.trajectories(), rank);
  OptimizerResult result;
  // A step is nearly always taken: then what it is judged by is where the next one begins.
  Expansion at = ExpansionAt(energy, x);
  for (int i = 0; i < max_iterations; ++i) {
    Eigen::Matrix2Xd step = JointStep(at, V);
    if (!step.allFinite()) break;
    for (Eigen::Index f = 0; f < x.cols(); ++f) {
      const double norm = step.col(f).norm();
      if (norm > kMaxStepPx) step.col(f) *= kMaxStepPx / norm;
    }

    double d = 1.0;
    Expansion there = ExpansionAt(energy, x + step);
    ++result.evaluations;
    while (there.value >= at.value && d > 0.1) {
      d *= 0.4;
      there = ExpansionAt(energy, x + d * step);
      ++result.evaluations;
    }
    ++result.iterations;
    if (there.value >= at.value) break;
    x += d * step;
    at = std::move(there);
    // The typical feature has come to rest.
    const Eigen::VectorXd lengths = step.colwise().norm();
    if (d * Median({lengths.begin(), lengths.end()}) < rest_px) break;
  }
  result.energy = at.value;
  result.x = std::move(x);
  return result;
}

}  // namespace cohort
