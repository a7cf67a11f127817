#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "frontend/geometry/sim3.h"

namespace cohort {

// The true point [m] at a pixel of a frame; nullopt if no surface is known there.
using PointTruth =
    std::function<std::optional<Eigen::Vector3d>(FrameIndex frame, const Eigen::Vector2d& xy)>;

// Distances [m] of the reconstructed points to the true points, after the alignment of the cameras
// (never an alignment of the points). A point's truth is the surface in its first view, where its
// feature began. Points without ground truth are skipped.
std::vector<double> PointErrors(const Reconstruction& reconstruction,
                                const Sim3& truth_from_reconstruction,
                                const PointTruth& truth);

}  // namespace cohort
