#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>

#include "frontend/geometry/rigid3.h"

namespace cohort {

// A known point and its normalised image point in a frame.
struct PointInFrame {
  Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
  Eigen::Vector2d n = Eigen::Vector2d::Zero();
};

struct AbsolutePose {
  Rigid3 cam_from_world;
  std::size_t inliers = 0;  // points with an error of at most max_error
};

// Estimates the pose of a frame from known points. Frames of a video have a good start (the
// neighbour's pose, or its motion carried on), from which Gauss-Newton with weights scaled by the
// median residual converges in microseconds. OpenCV's RANSAC is the fallback: it runs if there is
// no start or less than the share `enough` of the points lies within max_error (normalised units),
// and the better result is returned. Returns nullopt with fewer than 4 points or if both fail.
std::optional<AbsolutePose> EstimateAbsolutePose(std::span<const PointInFrame> points,
                                                 const std::optional<Rigid3>& start,
                                                 double max_error,
                                                 double enough = 0.6);

}  // namespace cohort
