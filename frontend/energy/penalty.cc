#include "frontend/energy/penalty.h"

#include <cmath>

namespace cohort {
namespace {

// Rounding may leave eigenvalues of a singular Gram matrix slightly below zero.
Eigen::ArrayXd Smoothed(const Eigen::VectorXd& eigenvalues, double smoothing) {
  return eigenvalues.array().max(0.0) + smoothing;
}

}  // namespace

double Penalty::Value(const Eigen::VectorXd& eigenvalues) const {
  const Eigen::ArrayXd lambda = Smoothed(eigenvalues, smoothing);
  switch (kind) {
    case PenaltyKind::kNone:
      break;
    case PenaltyKind::kEmpiricalDimension: {
      const double p = epsilon;
      const double norm_p = std::pow(lambda.pow(p / 2.0).sum(), 1.0 / p);
      if (p >= 1.0)
        return norm_p / std::sqrt(lambda.maxCoeff());  // q is infinite: the largest sigma
      const double q = p / (1.0 - p);
      return norm_p / std::pow(lambda.pow(q / 2.0).sum(), 1.0 / q);
    }
    case PenaltyKind::kNuclearNorm:
      return lambda.sqrt().sum();
    case PenaltyKind::kExplicitFactorization:
      // Ascending: the tail beyond the d largest comes first.
      return lambda.head(std::max<Eigen::Index>(lambda.size() - rank, 0)).sqrt().sum();
  }
  return 0.0;
}

Eigen::VectorXd Penalty::Weights(const Eigen::VectorXd& eigenvalues) const {
  // Without smoothing the cusp at zero is cut where rounding hides it.
  const double least = 1e-14 * std::max(eigenvalues.maxCoeff(), 1e-280);
  const Eigen::ArrayXd lambda = Smoothed(eigenvalues, smoothing).max(least);
  switch (kind) {
    case PenaltyKind::kNone:
      break;
    case PenaltyKind::kEmpiricalDimension: {
      // From log d = 1/p log S_p - 1/q log S_q, S_r = sum sigma_i^r:
      //   h_i = d (sigma_i^(p-2) / S_p - sigma_i^(q-2) / S_q)
      const double d = Value(eigenvalues);
      const double p = epsilon;
      const Eigen::ArrayXd first = lambda.pow(p / 2.0 - 1.0) / lambda.pow(p / 2.0).sum();
      Eigen::ArrayXd second = Eigen::ArrayXd::Zero(lambda.size());
      if (p >= 1.0) {
        second[lambda.size() - 1] = 1.0 / lambda[lambda.size() - 1];
      } else {
        const double q = p / (1.0 - p);
        second = lambda.pow(q / 2.0 - 1.0) / lambda.pow(q / 2.0).sum();
      }
      return d * (first - second);
    }
    case PenaltyKind::kNuclearNorm:
      return lambda.rsqrt();
    case PenaltyKind::kExplicitFactorization: {
      Eigen::VectorXd h = lambda.rsqrt();
      h.tail(std::min<Eigen::Index>(rank, h.size())).setZero();
      return h;
    }
  }
  return Eigen::VectorXd::Zero(lambda.size());
}

}  // namespace cohort
