#include "backend/adjust/absolute_pose.h"

#include <gtest/gtest.h>

#include <vector>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kMaxError = 4.0 / 500.0;  // 4 px at a focal length of 500 px

const Rigid3 kTruth{Eigen::Quaterniond(Eigen::AngleAxisd(0.4, Vector3d(1, 2, -1).normalized())),
                    Vector3d(0.3, -0.2, 1.0)};

// Points of a box before the camera; `relief` 0: all in one plane.
std::vector<PointInFrame> SeenPoints(int count, double relief = 1.0) {
  RandomStream random(3, "absolute_pose_test");
  const Rigid3 world_from_cam = kTruth.Inverse();
  std::vector<PointInFrame> points;
  for (int i = 0; i < count; ++i) {
    // One after the other: compilers draw the arguments of a call in orders of their own.
    const double y = random.Uniform(-0.4, 0.4);
    const Vector2d n(random.Uniform(-0.5, 0.5), y);
    const double depth = 5.0 + relief * random.Uniform(-2.0, 2.0);
    points.push_back({world_from_cam * (depth * n.homogeneous()), n});
  }
  return points;
}

void ExpectTruth(const std::optional<AbsolutePose>& pose, double tolerance) {
  ASSERT_TRUE(pose);
  EXPECT_LT(AngleBetween(pose->cam_from_world.rotation, kTruth.rotation), tolerance);
  EXPECT_LT((pose->cam_from_world.translation - kTruth.translation).norm(), tolerance);
}

// A neighbour's pose, some degrees and a tenth of the distance off.
Rigid3 Neighbour() {
  return {Eigen::Quaterniond(Eigen::AngleAxisd(0.05, Vector3d::UnitY())) * kTruth.rotation,
          kTruth.translation + Vector3d(0.3, 0.1, -0.2)};
}

TEST(AbsolutePose, RecoversThePoseOfNoiseFreePointsFromANeighboursPose) {
  const auto points = SeenPoints(30);
  const auto pose = EstimateAbsolutePose(points, Neighbour(), kMaxError);
  ExpectTruth(pose, 1e-8);
  EXPECT_EQ(pose->inliers, points.size());
}

TEST(AbsolutePose, RecoversThePoseOfNoiseFreePointsWithoutAStart) {
  const auto points = SeenPoints(30);
  const auto pose = EstimateAbsolutePose(points, std::nullopt, kMaxError);
  ExpectTruth(pose, 1e-6);
  EXPECT_EQ(pose->inliers, points.size());
}

TEST(AbsolutePose, RecoversThePoseOfAPlane) {
  ExpectTruth(EstimateAbsolutePose(SeenPoints(30, 0.0), Neighbour(), kMaxError), 1e-8);
}

TEST(AbsolutePose, PointsThatAreElsewhereInTheImageDoNotPull) {
  auto points = SeenPoints(60);
  RandomStream random(4, "outliers");
  for (std::size_t i = 0; i < points.size(); i += 3) {  // a third of them
    points[i].n = {random.Uniform(-0.5, 0.5), random.Uniform(-0.4, 0.4)};
  }
  for (const std::optional<Rigid3>& start : {std::optional(Neighbour()), std::optional<Rigid3>()}) {
    const auto pose = EstimateAbsolutePose(points, start, kMaxError);
    ExpectTruth(pose, 2e-3);
    EXPECT_GE(pose->inliers, 40u);
    EXPECT_LT(pose->inliers, 44u);
  }
}

TEST(AbsolutePose, AWrongStartIsReplacedByRansacs) {
  const Rigid3 wrong{Eigen::Quaterniond(Eigen::AngleAxisd(2.5, Vector3d::UnitX())),
                     Vector3d(5, 5, 5)};
  const auto pose = EstimateAbsolutePose(SeenPoints(40), wrong, kMaxError);
  ExpectTruth(pose, 1e-6);
}

TEST(AbsolutePose, NoiseGivesAPoseWithinItsUncertainty) {
  auto points = SeenPoints(200);
  RandomStream noise(5, "noise");
  for (PointInFrame& point : points) {
    const double y = noise.Gaussian();
    point.n += 0.001 * Vector2d(noise.Gaussian(), y);  // half a pixel
  }
  ExpectTruth(EstimateAbsolutePose(points, Neighbour(), kMaxError), 2e-3);
}

TEST(AbsolutePose, ThreePointsAreTooFew) {
  EXPECT_FALSE(EstimateAbsolutePose(SeenPoints(3), kTruth, kMaxError));
  EXPECT_FALSE(EstimateAbsolutePose({}, std::nullopt, kMaxError));
}

TEST(AbsolutePose, PointsAllInOnePlaceSayNothingOfThePose) {
  std::vector<PointInFrame> points(20, SeenPoints(1).front());
  const auto pose = EstimateAbsolutePose(points, std::nullopt, kMaxError);
  // No pose, or one whose numbers can be gone on with.
  if (pose) {
    EXPECT_TRUE(pose->cam_from_world.translation.allFinite());
    EXPECT_TRUE(pose->cam_from_world.rotation.coeffs().allFinite());
  }
}

TEST(AbsolutePose, PointsBehindTheCameraAreNoInliers) {
  auto points = SeenPoints(30);
  for (PointInFrame& point : points) {  // mirrored through the camera's centre: the same rays
    const Vector3d in_cam = kTruth * point.in_world;
    point.in_world = kTruth.Inverse() * Vector3d(-in_cam);
  }
  const auto pose = EstimateAbsolutePose(points, kTruth, kMaxError);
  if (pose) {
    EXPECT_LT(pose->inliers, points.size() / 2);
  }
}

}  // namespace
}  // namespace cohort
