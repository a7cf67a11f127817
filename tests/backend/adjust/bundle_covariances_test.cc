#include "backend/adjust/bundle_covariances.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

// Two points, each seen by both of two cameras with one intrinsic parameter: 2 rows an observation.
struct Problem {
  JacobianColumns columns{{0, 2}, {1, 2}, {0}};
  Eigen::MatrixXd dense = Eigen::MatrixXd::Zero(40, 3 * 2 + 6 * 2 + 1);
  ceres::CRSMatrix sparse;

  Problem() {
    RandomStream random(1, "bundle_covariances_test");
    for (int row = 0; row < dense.rows(); ++row) {
      const int point = row % 2;
      const int camera = (row / 2) % 2;
      for (int k = 0; k < 3; ++k) dense(row, 3 * point + k) = random.Gaussian();
      for (int k = 0; k < 6; ++k) dense(row, 6 + 6 * camera + k) = random.Gaussian();
      dense(row, 18) = random.Gaussian();
    }
    Compress();
  }

  void Compress() {
    sparse = {};
    sparse.num_rows = static_cast<int>(dense.rows());
    sparse.num_cols = static_cast<int>(dense.cols());
    sparse.rows.push_back(0);
    for (int row = 0; row < dense.rows(); ++row) {
      for (int col = 0; col < dense.cols(); ++col) {
        if (dense(row, col) == 0.0) continue;
        sparse.cols.push_back(col);
        sparse.values.push_back(dense(row, col));
      }
      sparse.rows.push_back(static_cast<int>(sparse.cols.size()));
    }
  }
};

TEST(BundleCovariances, AreTheBlocksOfTheInverseOfTheNormalEquations) {
  const Problem problem;
  const Eigen::MatrixXd expected = (problem.dense.transpose() * problem.dense).inverse();
  const auto result = CovariancesFromJacobian(problem.sparse, problem.columns, 3, 3);
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->points[0].isApprox(expected.block(0, 0, 3, 3), 1e-9));
  EXPECT_TRUE(result->points[2].isApprox(expected.block(3, 3, 3, 3), 1e-9));
  EXPECT_TRUE(result->cameras[1].isApprox(expected.block(6, 6, 6, 6), 1e-9));
  EXPECT_TRUE(result->cameras[2].isApprox(expected.block(12, 12, 6, 6), 1e-9));
  EXPECT_NEAR(result->intrinsics(0, 0), expected(18, 18), 1e-9);
}

TEST(BundleCovariances, OfWhatHasNoColumnsAreZero) {
  const Problem problem;
  const auto result = CovariancesFromJacobian(problem.sparse, problem.columns, 3, 3);
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->points[1].isZero());
  EXPECT_TRUE(result->cameras[0].isZero());
  EXPECT_EQ(result->intrinsics(1, 1), 0.0);
}

TEST(BundleCovariances, ThereAreNoneOfAProblemThatIsRankDeficient) {
  Problem problem;
  problem.dense.col(17).setZero();  // nothing depends on it
  problem.Compress();
  EXPECT_FALSE(CovariancesFromJacobian(problem.sparse, problem.columns, 3, 3));
  problem.dense.col(2).setZero();
  problem.Compress();
  EXPECT_FALSE(CovariancesFromJacobian(problem.sparse, problem.columns, 3, 3));
}

}  // namespace
}  // namespace cohort
