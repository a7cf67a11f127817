#include "backend/geometry/triangulation.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace cohort {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Ray RayFrom(const Vector3d& center, const Vector3d& point) {
  const Rigid3 cam_from_world{Eigen::Quaterniond::Identity(), -center};
  return {cam_from_world, (cam_from_world * point).hnormalized()};
}

TEST(Triangulation, TwoRaysMeetInThePointTheyCameFrom) {
  const Vector3d point(0.3, -0.2, 4.0);
  const std::array rays{RayFrom({-1, 0, 0}, point), RayFrom({1, 0, 0}, point)};
  const auto x = Triangulate(rays);
  ASSERT_TRUE(x);
  EXPECT_LT((*x - point).norm(), 1e-12);
}

TEST(Triangulation, SplitsAVerticalDisparityEvenly) {
  // Cameras at (-1, 0, 0) and (1, 0, 0), both looking along z; the rays pass each other at z = 4,
  // one at y = 0.04 and one at y = -0.04: the least-squares point lies between them at y = 0.
  const std::array rays{Ray{{Eigen::Quaterniond::Identity(), {1, 0, 0}}, {0.25, 0.01}},
                        Ray{{Eigen::Quaterniond::Identity(), {-1, 0, 0}}, {-0.25, -0.01}}};
  const auto x = Triangulate(rays);
  ASSERT_TRUE(x);
  EXPECT_LT((*x - Vector3d(0, 0, 4)).norm(), 1e-9);
}

TEST(Triangulation, RaysFarFromTheOriginMeetAsWellAsNearIt) {
  for (const double offset : {0.0, 5e5, 4e6}) {
    const Vector3d origin(offset, 0.2 * offset, 0.9 * offset);
    const Vector3d point = origin + Vector3d(0.3, -0.2, 4.0);
    const std::array rays{RayFrom(origin + Vector3d(-0.1, 0, 0), point),
                          RayFrom(origin + Vector3d(0.1, 0, 0), point)};
    const auto x = Triangulate(rays);
    ASSERT_TRUE(x) << offset;
    EXPECT_LT((*x - point).norm(), 1e-6) << offset;
  }
}

TEST(Triangulation, ParallelRaysMeetAtInfinity) {
  const std::array rays{RayFrom({-1, 0, 0}, {-1, 0, 5}), RayFrom({1, 0, 0}, {1, 0, 5})};
  EXPECT_NEAR(TriangulateDlt(rays).w(), 0.0, 1e-12);
  EXPECT_FALSE(Triangulate(rays));
}

TEST(Triangulation, APointBehindTheCamerasIsNone) {
  const std::array rays{Ray{{Eigen::Quaterniond::Identity(), {1, 0, 0}}, {-0.25, 0.0}},
                        Ray{{Eigen::Quaterniond::Identity(), {-1, 0, 0}}, {0.25, 0.0}}};
  EXPECT_FALSE(Triangulate(rays));  // diverging rays meet at z = -4
}

TEST(Triangulation, OneRayIsNotEnough) {
  const std::array rays{RayFrom({0, 0, 0}, {0, 0, 1})};
  EXPECT_FALSE(Triangulate(rays));
}

TEST(Triangulation, RobustFindsTheRaysThatAgree) {
  const Vector3d point(0.1, 0.2, 5.0);
  std::vector<Ray> rays;
  for (int i = 0; i < 12; ++i) rays.push_back(RayFrom({0.1 * i, 0.02 * i * i, 0}, point));
  rays[0].n += Vector2d(0.2, 0.1);
  rays[5].n += Vector2d(-0.1, 0.3);
  rays[11].n += Vector2d(0.0, -0.2);
  const auto x = TriangulateRobustly(rays, 1e-3, 3);
  ASSERT_TRUE(x);
  EXPECT_EQ(x->inliers, 9u);
  EXPECT_LT((x->in_world - point).norm(), 1e-9);
  EXPECT_FALSE(TriangulateRobustly(rays, 1e-3, 10));
}

TEST(Triangulation, AngleIsThatOfTheTriangle) {
  EXPECT_NEAR(TriangulationAngle({0, 0, 1}, {-1, 0, 0}, {1, 0, 0}), std::numbers::pi / 2, 1e-12);
  EXPECT_NEAR(TriangulationAngle({0, 0, 1}, {0, 0, 0}, {0, 0, -3}), 0.0, 1e-12);
}

}  // namespace
}  // namespace cohort
