#include "backend/geometry/weighted_triangulation.h"

#include <gtest/gtest.h>

#include <array>
#include <numbers>

namespace cohort {
namespace {

using Eigen::Vector3d;

Ray RayTo(const Vector3d& center, const Vector3d& point) {
  const Rigid3 cam_from_world{Eigen::Quaterniond::Identity(), -center};
  return {cam_from_world, (cam_from_world * point).hnormalized()};
}

// Two cameras side by side, b apart, and a point z straight ahead of their middle: with a standard
// deviation s of every coordinate of n, depth has z^2 s sqrt(2) / b, and x and y z s / sqrt(2).
TEST(WeightedTriangulation, HasTheCovarianceOfTwoCameras) {
  constexpr double b = 0.2;
  constexpr double z = 4.0;
  constexpr double s = 1e-3;
  const Vector3d point(0.0, 0.0, z);
  const Eigen::Matrix2d information = Eigen::Matrix2d::Identity() / (s * s);
  const std::array rays{WeightedRay{RayTo({-b / 2, 0, 0}, point), information},
                        WeightedRay{RayTo({b / 2, 0, 0}, point), information}};
  const auto found = TriangulateWeighted(rays, Vector3d(0.3, -0.2, 5.0));
  ASSERT_TRUE(found);
  EXPECT_LT((found->in_world - point).norm(), 1e-6);
  const Vector3d sigma = found->covariance.diagonal().cwiseSqrt();
  EXPECT_NEAR(sigma.z(), z * z * s * std::numbers::sqrt2 / b, 0.01 * sigma.z());
  EXPECT_NEAR(sigma.y(), z * s / std::numbers::sqrt2, 0.01 * sigma.y());
}

TEST(WeightedTriangulation, BelievesTheRayThatIsSurer) {
  // They pass each other at z = 4, one at y = 0.04 and one at y = -0.04; the first one counts nine
  // times as much.
  const std::array rays{
      WeightedRay{{{Eigen::Quaterniond::Identity(), {1, 0, 0}}, {0.25, 0.01}},
                  9.0 * Eigen::Matrix2d::Identity()},
      WeightedRay{{{Eigen::Quaterniond::Identity(), {-1, 0, 0}}, {-0.25, -0.01}}}};
  const auto found = TriangulateWeighted(rays, Vector3d(0, 0, 4));
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->in_world.y(), 0.8 * 0.04, 1e-4);
}

TEST(WeightedTriangulation, FindsNoPointOfParallelRays) {
  const std::array rays{WeightedRay{RayTo({0, 0, 0}, {0, 0, 5})},
                        WeightedRay{RayTo({0, 0, 0}, {0, 0, 5})}};
  EXPECT_FALSE(TriangulateWeighted(rays, Vector3d(0, 0, 5)));
}

}  // namespace
}  // namespace cohort
