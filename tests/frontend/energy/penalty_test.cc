#include "frontend/energy/penalty.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include "frontend/core/random_stream.h"
#include "frontend/energy/trajectory_matrix.h"
#include "tests/support/numeric_gradient.h"

namespace cohort {
namespace {

// Trajectories of `features` points of a rigid scene under an affine camera, with noise: rank 3 +
// noise.
struct Trajectories {
  Eigen::MatrixXd history;  // 2 L x F
  Eigen::Matrix2Xd current;
};

Trajectories RigidTrajectories(int features, int history_length, double noise_px) {
  RandomStream random(7, "test/rigid");
  Eigen::MatrixXd shape(4, features);
  for (int f = 0; f < features; ++f) {
    shape.col(f) << random.Uniform(-300, 300), random.Uniform(-200, 200), random.Uniform(-1, 1),
        1.0;
  }
  Eigen::MatrixXd all(2 * (history_length + 1), features);
  for (int l = 0; l <= history_length; ++l) {
    Eigen::Matrix<double, 2, 4> camera;
    camera << 1.0, 0.001 * l, 6.0 * l, 320.0 + 3.0 * l, -0.001 * l, 1.0, 2.0 * l, 240.0 - 2.0 * l;
    all.middleRows(2 * l, 2) = camera * shape;
  }
  for (Eigen::Index i = 0; i < all.size(); ++i) all(i) += noise_px * random.Gaussian();
  return {all.bottomRows(2 * history_length), all.topRows(2)};
}

double PenaltyAt(const Penalty& penalty, const TrajectoryMatrix& M, const Eigen::Matrix2Xd& x) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(M.Gram(x), Eigen::EigenvaluesOnly);
  return penalty.Value(eigen.eigenvalues());
}

Eigen::Matrix2Xd GradientAt(const Penalty& penalty,
                            const TrajectoryMatrix& M,
                            const Eigen::Matrix2Xd& x) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(M.Gram(x));
  const Eigen::VectorXd h = penalty.Weights(eigen.eigenvalues());
  const Eigen::MatrixXd& U = eigen.eigenvectors();
  return M.TopRowsOfProduct(U * h.asDiagonal() * U.transpose(), x);
}

struct Case {
  PenaltyKind kind;
  double epsilon;
  bool centered;
};

class PenaltyGradient : public testing::TestWithParam<Case> {};

TEST_P(PenaltyGradient, MatchesCentralDifferences) {
  const Case c = GetParam();
  for (const int history_length : {1, 5, 10}) {
    for (const int features : {8, 35}) {
      const Trajectories t = RigidTrajectories(features, history_length, 0.5);
      const TrajectoryMatrix M(t.history, c.centered);
      Penalty penalty;
      penalty.kind = c.kind;
      penalty.epsilon = c.epsilon;
      penalty.rank = c.centered ? 3 : 4;
      penalty.smoothing = features * 0.01;
      const Eigen::Matrix2Xd exact = GradientAt(penalty, M, t.current);
      const Eigen::Matrix2Xd numeric = test::NumericGradient(
          [&](const Eigen::Matrix2Xd& x) { return PenaltyAt(penalty, M, x); }, t.current, 1e-3);
      EXPECT_LT((exact - numeric).norm(), 1e-4 * numeric.norm() + 1e-9)
          << "L = " << history_length << ", F = " << features;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AllPenalties,
                         PenaltyGradient,
                         testing::Values(Case{PenaltyKind::kEmpiricalDimension, 0.6, true},
                                         Case{PenaltyKind::kEmpiricalDimension, 0.6, false},
                                         Case{PenaltyKind::kEmpiricalDimension, 0.3, true},
                                         Case{PenaltyKind::kEmpiricalDimension, 0.5, true},
                                         Case{PenaltyKind::kEmpiricalDimension, 1.0, true},
                                         Case{PenaltyKind::kNuclearNorm, 0.6, true},
                                         Case{PenaltyKind::kNuclearNorm, 0.6, false},
                                         Case{PenaltyKind::kExplicitFactorization, 0.6, true},
                                         Case{PenaltyKind::kExplicitFactorization, 0.6, false}));

TEST(Penalty, ThroughTheGramMatrixEqualsAPlainSvd) {
  const Trajectories t = RigidTrajectories(35, 10, 0.5);
  for (const bool centered : {true, false}) {
    const TrajectoryMatrix M(t.history, centered);
    Eigen::MatrixXd full(M.rows(), M.features());
    full << t.current, t.history;
    if (centered) full.colwise() -= full.rowwise().mean().eval();
    const Eigen::VectorXd sigma = full.jacobiSvd().singularValues();  // descending
    Penalty penalty;
    penalty.kind = PenaltyKind::kNuclearNorm;
    EXPECT_NEAR(PenaltyAt(penalty, M, t.current) / sigma.sum(), 1.0, 1e-9);
    penalty.kind = PenaltyKind::kExplicitFactorization;
    penalty.rank = 3;
    EXPECT_NEAR(PenaltyAt(penalty, M, t.current) / sigma.tail(sigma.size() - 3).sum(), 1.0, 1e-6);
    penalty.kind = PenaltyKind::kEmpiricalDimension;
    const double d = std::pow(sigma.array().pow(0.6).sum(), 1 / 0.6) /
                     std::pow(sigma.array().pow(1.5).sum(), 1 / 1.5);
    EXPECT_NEAR(PenaltyAt(penalty, M, t.current) / d, 1.0, 1e-9);
  }
}

TEST(EmpiricalDimension, OfKEqualSingularValuesIsK) {
  Penalty penalty;
  for (const double epsilon : {0.2, 0.6, 1.0}) {
    penalty.epsilon = epsilon;
    for (int k = 1; k <= 5; ++k) {
      Eigen::VectorXd eigenvalues = Eigen::VectorXd::Zero(8);
      eigenvalues.tail(k).setConstant(49.0);
      EXPECT_NEAR(penalty.Value(eigenvalues), k, 1e-9 * k) << "epsilon " << epsilon;
    }
  }
}

TEST(EmpiricalDimension, DoesNotChangeWithScale) {
  const Trajectories t = RigidTrajectories(20, 5, 0.5);
  const TrajectoryMatrix M(t.history, true);
  const TrajectoryMatrix half(0.5 * t.history, true);
  const Penalty penalty;
  EXPECT_NEAR(PenaltyAt(penalty, M, t.current), PenaltyAt(penalty, half, 0.5 * t.current), 1e-9);
}

TEST(Penalty, IsSmoothWhereSingularValuesVanish) {
  // Noise-free: all but three singular values are zero, where the bare penalties have a cusp.
  const Trajectories t = RigidTrajectories(20, 5, 0.0);
  const TrajectoryMatrix M(t.history, true);
  for (const auto& [name, kind] : kPenaltyNames) {
    Penalty penalty;
    penalty.kind = kind;
    penalty.smoothing = 20 * 0.04;
    const Eigen::Matrix2Xd exact = GradientAt(penalty, M, t.current);
    EXPECT_TRUE(exact.allFinite()) << name;
    const Eigen::Matrix2Xd numeric = test::NumericGradient(
        [&](const Eigen::Matrix2Xd& x) { return PenaltyAt(penalty, M, x); }, t.current, 1e-3);
    EXPECT_LT((exact - numeric).cwiseAbs().maxCoeff(), 1e-4) << name;
  }
}

TEST(TrajectoryMatrix, GramAlongALineIsAQuadratic) {
  const Trajectories t = RigidTrajectories(12, 4, 1.0);
  RandomStream random(3, "test/direction");
  Eigen::Matrix2Xd c(2, 12);
  for (Eigen::Index i = 0; i < c.size(); ++i) c(i) = random.Gaussian();
  for (const bool centered : {true, false}) {
    const TrajectoryMatrix M(t.history, centered);
    const TrajectoryMatrix::Line line = M.AlongLine(t.current, c);
    for (const double d : {-1.5, 0.0, 0.7, 3.0}) {
      const Eigen::MatrixXd direct = M.Gram(t.current + d * c);
      EXPECT_LT((line.At(d) - direct).norm(), 1e-12 * direct.norm());
    }
  }
}

TEST(TrajectoryMatrix, ACommonShiftCostsNothingWhenCentred) {
  const Trajectories t = RigidTrajectories(12, 4, 0.3);
  const TrajectoryMatrix M(t.history, true);
  const Eigen::Matrix2Xd shifted = t.current.colwise() + Eigen::Vector2d(40, -25);
  EXPECT_LT((M.Gram(t.current) - M.Gram(shifted)).norm(), 1e-9 * M.Gram(shifted).norm());
}

}  // namespace
}  // namespace cohort
