#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <fstream>
#include <string>
#include <vector>

namespace cohort::test {

// Reads a bundle adjustment problem by the published format; the reprojection errors of its
// observations [px].
inline std::vector<double> BalErrors(const std::string& path) {
  std::ifstream in(path);
  std::size_t cameras = 0;
  std::size_t points = 0;
  std::size_t observations = 0;
  in >> cameras >> points >> observations;
  struct Row {
    std::size_t camera, point;
    double x, y;
  };
  std::vector<Row> rows(observations);
  for (Row& row : rows) in >> row.camera >> row.point >> row.x >> row.y;
  std::vector<double> parameters(9 * cameras + 3 * points);
  for (double& value : parameters) in >> value;
  EXPECT_TRUE(in.good() || in.eof());
  std::vector<double> errors;
  for (const Row& row : rows) {
    const double* c = parameters.data() + 9 * row.camera;
    const Eigen::Vector3d r(c[0], c[1], c[2]);
    const Eigen::Vector3d X(parameters.data() + 9 * cameras + 3 * row.point);
    const Eigen::Vector3d P =
        Eigen::AngleAxisd(r.norm(), r.normalized()) * X + Eigen::Vector3d(c[3], c[4], c[5]);
    EXPECT_LT(P.z(), 0.0);
    const Eigen::Vector2d p = -P.head<2>() / P.z();
    const double r2 = p.squaredNorm();
    const Eigen::Vector2d xy = c[6] * (1 + c[7] * r2 + c[8] * r2 * r2) * p;
    errors.push_back((xy - Eigen::Vector2d(row.x, row.y)).norm());
  }
  return errors;
}

}  // namespace cohort::test
