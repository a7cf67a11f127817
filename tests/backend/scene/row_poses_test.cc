#include "backend/scene/row_poses.h"

#include <gtest/gtest.h>

#include <cmath>

namespace cohort {
namespace {

constexpr int kHeightPx = 480;
constexpr double kReadout = 0.6;

const Camera kCamera{
    .width_px = 640, .height_px = kHeightPx, .fx = 500, .fy = 500, .cx = 320, .cy = 240};

double Tau(double y) { return kReadout * ((y + 0.5) / kHeightPx - 0.5); }

// A camera that flies a curve of third degree and turns about an axis at a rate that changes.
Eigen::Vector3d CenterAt(double t) { return {0.1 * t, 0.02 * t * t, -0.004 * t * t * t}; }
Rigid3 PoseAt(double t) {
  const Eigen::Quaterniond rotation(
      Eigen::AngleAxisd(0.05 * t + 0.01 * t * t, Eigen::Vector3d(0.6, 0.8, 0.0)));
  return {rotation, -(rotation * CenterAt(t))};
}

std::map<FrameIndex, Rigid3> Poses(std::initializer_list<std::uint32_t> frames) {
  std::map<FrameIndex, Rigid3> poses;
  for (const std::uint32_t f : frames) poses[FrameIndex{f}] = PoseAt(f);
  return poses;
}

TEST(RowPoses, OfTheMiddleRowIsTheFrames) {
  const RowPoses rows(Poses({0, 1, 2}), kReadout, kCamera);
  const Rigid3 pose = rows.CamFromWorld(FrameIndex{1}, {0.0, 0.5 * kHeightPx - 0.5});
  EXPECT_LT((pose.translation - PoseAt(1).translation).norm(), 1e-12);
  EXPECT_LT(AngleBetween(pose.rotation, PoseAt(1).rotation), 1e-9);
}

TEST(RowPoses, FollowThePolynomialOfTheNeighbours) {
  // Frame 3 is missing: the neighbours of 2 are at -2, -1, 2 and 3 frames.
  const RowPoses rows(Poses({0, 1, 2, 4, 5}), kReadout, kCamera);
  for (const double y : {0.0, 100.0, 479.0}) {
    const Rigid3 pose = rows.CamFromWorld(FrameIndex{2}, {0.0, y});
    EXPECT_LT((pose.Inverse().translation - CenterAt(2 + Tau(y))).norm(), 1e-9) << y;
    EXPECT_LT(AngleBetween(pose.rotation, PoseAt(2 + Tau(y)).rotation), 1e-9) << y;
  }
}

// A path of sixth degree is that of six neighbours and the frame, and of no fewer.
TEST(RowPoses, ThreeNeighboursOnEachSideTellASway) {
  const auto center_at = [](double t) {
    return Eigen::Vector3d(0.01 * t * t * t * t * t, -0.001 * std::pow(t, 6), 0.1 * t);
  };
  std::map<FrameIndex, Rigid3> poses;
  for (std::uint32_t f = 0; f < 7; ++f) {
    poses[FrameIndex{f}] = {Eigen::Quaterniond::Identity(), -center_at(f - 3.0)};
  }
  const RowPoses rows(poses, kReadout, kCamera);
  for (const double y : {0.0, 100.0, 479.0}) {
    const Rigid3 pose = rows.CamFromWorld(FrameIndex{3}, {0.0, y});
    EXPECT_LT((pose.Inverse().translation - center_at(Tau(y))).norm(), 1e-9) << y;
  }
}

TEST(RowPoses, WithoutNeighboursOrAReadoutNothingMoves) {
  const Rigid3 alone =
      RowPoses(Poses({0, 9}), kReadout, kCamera).CamFromWorld(FrameIndex{9}, {0, 0});
  EXPECT_LT((alone.translation - PoseAt(9).translation).norm(), 1e-12);
  const Rigid3 global =
      RowPoses(Poses({0, 1, 2}), 0.0, kCamera).CamFromWorld(FrameIndex{1}, {0, 0});
  EXPECT_EQ(global.translation, PoseAt(1).translation);
}

// The row where it is seen is the row whose pose shows it there.
TEST(RowPoses, ProjectFindsTheRow) {
  for (const auto& [name, order] : kRowOrderNames) {
    SCOPED_TRACE(name);
    Camera camera = kCamera;
    camera.row_order = order;
    const RowPoses rows(Poses({0, 1, 2, 3, 4}), kReadout, camera);
    for (const Eigen::Vector3d& point :
         {Eigen::Vector3d(0.3, 1.0, 4.0), Eigen::Vector3d(-1.0, -0.2, 5.0)}) {
      const auto xy = rows.Project(camera, FrameIndex{2}, point);
      ASSERT_TRUE(xy);
      const auto again = camera.Project(rows.CamFromWorld(FrameIndex{2}, *xy) * point);
      EXPECT_LT((*again - *xy).norm(), 1e-5);
    }
    EXPECT_FALSE(rows.Project(camera, FrameIndex{2}, {0, 0, -4}));
  }
}

// The sensor's first row is exposed as long before the middle as its last row after it.
TEST(RowPoses, TurnedPicturesHaveTheSensorsRowsElsewhere) {
  struct Turned {
    RowOrder order;
    Eigen::Vector2d first, last;  // pixels of the first and last row
  };
  for (const Turned& turned : {Turned{RowOrder::kDown, {7, -0.5}, {7, 479.5}},
                               Turned{RowOrder::kUp, {7, 479.5}, {7, -0.5}},
                               Turned{RowOrder::kRight, {-0.5, 7}, {639.5, 7}},
                               Turned{RowOrder::kLeft, {639.5, 7}, {-0.5, 7}}}) {
    SCOPED_TRACE(NameOf(kRowOrderNames, turned.order));
    Camera camera = kCamera;
    camera.row_order = turned.order;
    const RowPoses rows(Poses({0, 1, 2, 3, 4}), kReadout, camera);
    const auto center = [&](const Eigen::Vector2d& xy) {
      return rows.CamFromWorld(FrameIndex{2}, xy).Inverse().translation.eval();
    };
    EXPECT_LT((center(turned.first) - CenterAt(2 - 0.5 * kReadout)).norm(), 1e-9);
    EXPECT_LT((center(turned.last) - CenterAt(2 + 0.5 * kReadout)).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace cohort
