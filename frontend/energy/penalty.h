#pragma once

#include <Eigen/Core>

#include "frontend/core/options.h"

namespace cohort {

// P(x), eq. (4) of Poling, Lerman, Szlam (CVPR 2014), section 3.2: measures the dimension of the
// trajectory matrix M (the features' positions in the last L frames; LevelEnergy) by its singular
// values sigma_1 >= sigma_2 >= ...
enum class PenaltyKind {
  kNone,                   // 0: the features are independent, eq. (2)
  kEmpiricalDimension,     // eq. (6): |sigma|_eps / |sigma|_(eps / (1 - eps)), any eps in (0, 1]
  kNuclearNorm,            // eq. (5): sum sigma_i
  kExplicitFactorization,  // below eq. (4): sum of sigma_i beyond i = d, d = 3 centred, 4 uncentred
};
inline constexpr ChoiceNames<PenaltyKind, 4> kPenaltyNames{
    {{"none", PenaltyKind::kNone},
     {"empirical-dimension", PenaltyKind::kEmpiricalDimension},
     {"nuclear-norm", PenaltyKind::kNuclearNorm},
     {"explicit-factorization", PenaltyKind::kExplicitFactorization}}};

struct Penalty {
  PenaltyKind kind = PenaltyKind::kEmpiricalDimension;
  double epsilon = 0.6;  // of the empirical dimension
  int rank = 3;          // d of the explicit factorisation; JointGuide sets it
  double smoothing =
      0.0;  // added to every eigenvalue [px^2]: rounds the cusp at sigma = 0; likewise

  // Takes the eigenvalues of the Gram matrix G = M M', ascending: lambda_i = sigma_i^2.
  double Value(const Eigen::VectorXd& eigenvalues) const;
  // h_i = phi'_i(sigma) / sigma_i, so that dP/dM = H M with H = U diag(h) U', G = U diag(lambda)
  // U'. Only the small Gram matrix is decomposed.
  Eigen::VectorXd Weights(const Eigen::VectorXd& eigenvalues) const;
};

}  // namespace cohort
