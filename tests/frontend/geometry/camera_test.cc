#include "frontend/geometry/camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <vector>

#include "tests/support/cameras.h"

namespace cohort {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

std::vector<Camera> AllCameras() {
  Camera four = test::FreiburgCamera();
  four.k3 = 0.0;
  four.k2 = 0.02;
  Camera ideal = test::FisheyeCamera();
  ideal.k1 = ideal.k2 = ideal.k3 = ideal.k4 = 0.0;
  return {four, test::FreiburgCamera(), test::RationalCamera(), test::FisheyeCamera(), ideal};
}

// OpenCV's own projection.
Vector2d ProjectByOpenCv(const Camera& c, const Vector3d& x) {
  const std::vector<cv::Point3d> points{{x.x(), x.y(), x.z()}};
  const cv::Matx33d k(c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1);
  const cv::Vec3d zero(0, 0, 0);
  std::vector<cv::Point2d> xy;
  if (c.model == CameraModel::kFisheye) {
    cv::fisheye::projectPoints(points, xy, zero, zero, k, cv::Vec4d(c.k1, c.k2, c.k3, c.k4));
  } else {
    const std::vector<double> d{c.k1, c.k2, c.p1, c.p2, c.k3, c.k4, c.k5, c.k6};
    cv::projectPoints(points, zero, zero, k, d, xy);
  }
  return {xy[0].x, xy[0].y};
}

TEST(Camera, ProjectsAsOpenCvDoes) {
  for (const Camera& camera : AllCameras()) {
    for (const Vector3d& x : {Vector3d(0.1, -0.2, 1),
                              Vector3d(-1.1, 0.8, 2),
                              Vector3d(1.5, 1.2, 2),
                              Vector3d(0, 0, 3)}) {
      const auto xy = camera.Project(x);
      ASSERT_TRUE(xy);
      EXPECT_LT((*xy - ProjectByOpenCv(camera, x)).norm(), 1e-9);
    }
    EXPECT_FALSE(camera.Project({0.1, 0.1, 0.0}));
    EXPECT_FALSE(camera.Project({0.1, 0.1, -1.0}));
  }
}

TEST(Camera, AFisheyeWithoutCoefficientsIsEquidistant) {
  Camera camera = test::FisheyeCamera();
  camera.k1 = camera.k2 = camera.k3 = camera.k4 = 0.0;
  for (const double degrees : {1e-4, 10.0, 45.0, 60.0, 80.0}) {
    const double angle = degrees / 180.0 * std::numbers::pi;
    const auto xy = camera.Project({std::sin(angle), 0.0, std::cos(angle)});
    EXPECT_NEAR(xy->x(), camera.cx + camera.fx * angle, 1e-10) << degrees;
    EXPECT_NEAR(camera.Unproject(*xy).x(), std::tan(angle), 1e-10 * (1 + std::tan(angle)));
  }
  EXPECT_TRUE(camera.HasDistortion());
}

// In each pixel of a grid, the corners and somewhat beyond.
TEST(Camera, UnprojectIsTheInverseOfProjectUpToTheCorners) {
  for (const Camera& camera : AllCameras()) {
    for (double y = -5; y <= camera.height_px + 5; y += (camera.height_px + 9) / 12.0) {
      for (double x = -5; x <= camera.width_px + 5; x += (camera.width_px + 9) / 16.0) {
        const Vector2d n = camera.Unproject({x, y});
        const auto xy = camera.Project(n.homogeneous());
        EXPECT_LT((*xy - Vector2d(x, y)).norm(), 1e-8)
            << NameOf(kCameraModelNames, camera.model) << " k3 " << camera.k3 << " at " << x << ", "
            << y;
        EXPECT_GT(Distort(camera, n).d_n.determinant(), 0.0) << "beyond where the lens turns";
      }
    }
  }
}

TEST(Camera, TheAxisIsAtThePrincipalPoint) {
  for (const Camera& camera : AllCameras()) {
    EXPECT_EQ(camera.Unproject({camera.cx, camera.cy}), Vector2d::Zero());
    EXPECT_EQ(*camera.Project({0, 0, 2}), Vector2d(camera.cx, camera.cy));
  }
}

TEST(Camera, APixelThatNoRayReachesHasAFiniteRay) {
  Camera turning = test::FisheyeCamera();
  turning.k1 = -0.3;  // grows up to theta = 1.05 only
  turning.k2 = turning.k3 = turning.k4 = 0.0;
  Camera barrel = test::RationalCamera();
  barrel.k3 = -0.5;
  Camera pole = test::RationalCamera();
  pole.k6 = -0.2;
  for (const Camera& camera : {turning, barrel, pole, test::FisheyeCamera()}) {
    for (const Vector2d& xy : {Vector2d(-3000, 200), Vector2d(1e5, 1e5), Vector2d(300, -1e4)}) {
      const Vector2d n = camera.Unproject(xy);
      EXPECT_TRUE(n.allFinite());
      const Vector2d off(xy.x() - camera.cx, xy.y() - camera.cy);
      EXPECT_GT(n.normalized().dot(off.normalized()), 0.9) << "towards the pixel";
    }
  }
  // Where the lens turns, its outermost ray: the slope of theta - 0.3 theta^3 is 0.
  const Vector2d edge = turning.Unproject({turning.cx + 3000, turning.cy});
  EXPECT_NEAR(std::atan(edge.x()), 1.0 / std::sqrt(0.9), 1e-6);
  // What lies beyond it is not seen, though the polynomial leads back into the picture.
  EXPECT_TRUE(turning.Project({std::tan(1.0), 0.0, 1.0}));
  EXPECT_FALSE(turning.Project({std::tan(1.5), 0.0, 1.0}));
}

TEST(Camera, DistortionDerivativesMatchCentralDifferences) {
  constexpr double kStep = 1e-6;
  for (const Camera& camera : AllCameras()) {
    for (const Vector2d& n : {Vector2d(0.3, -0.2),
                              Vector2d(-0.7, 0.4),
                              Vector2d(3e-5, 5e-5),
                              Vector2d(8e-5, 7e-5),
                              Vector2d(0, 0)}) {
      const DistortedPoint at = Distort(camera, n);
      for (int k = 0; k < 2; ++k) {
        const Vector2d delta = kStep * Vector2d::Unit(k);
        const Vector2d numeric =
            (Distort(camera, n + delta).n_d - Distort(camera, n - delta).n_d) / (2 * kStep);
        EXPECT_LT((at.d_n.col(k) - numeric).norm(), 1e-8);
        Camera more = camera;
        Camera less = camera;
        (k == 0 ? more.k1 : more.k2) += kStep;
        (k == 0 ? less.k1 : less.k2) -= kStep;
        const Vector2d by_coefficient = (Distort(more, n).n_d - Distort(less, n).n_d) / (2 * kStep);
        EXPECT_LT((at.d_k1_k2.col(k) - by_coefficient).norm(), 1e-8);
      }
    }
  }
}

// A picture's pixels cannot tell which of the two formulas computed them.
TEST(Camera, FourCoefficientsAreEightWhoseLastAreZero) {
  const Camera four = AllCameras().front();
  ASSERT_TRUE(four.HasAtMostFourCoefficients());
  for (const Vector2d& n : {Vector2d(0.3, -0.2), Vector2d(-0.5, 0.4)}) {
    const Vector2d n_d = Distort(four, n).n_d;
    const Vector2d xy(four.fx * n_d.x() + four.cx, four.fy * n_d.y() + four.cy);
    EXPECT_LT((*four.Project(n.homogeneous()) - xy).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace cohort
