#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>

#include "frontend/geometry/rigid3.h"

namespace cohort {

// A known point and where a frame sees it, as a normalised image point.
struct PointInFrame {
  Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
  Eigen::Vector2d n = Eigen::Vector2d::Zero();
};

struct AbsolutePose {
  Rigid3 cam_from_world;
  std::size_t inliers = 0;  // points within max_error of their place
};

// The pose that sees the points where they were seen. Frames of a video have a good start (the
// neighbour's pose, or its motion carried on): Gauss-Newton with weights scaled by the median
// residual finds it in microseconds. Where it does not bring `enough` (a share) of the points
// within max_error (normalised units), or there is no start, OpenCV's RANSAC tries, and the better
// of the two is returned. None with fewer than 4 points or where both fail.
std::optional<AbsolutePose> EstimateAbsolutePose(std::span<const PointInFrame> points,
                                                 const std::optional<Rigid3>& start,
                                                 double max_error,
                                                 double enough = 0.6);

}  // namespace cohort
