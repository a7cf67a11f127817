#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "frontend/geometry/sim3.h"

namespace cohort {

// The true point [m] that is seen at a pixel of a frame; none where the truth knows of no surface.
using PointTruth =
    std::function<std::optional<Eigen::Vector3d>(FrameIndex frame, const Eigen::Vector2d& xy)>;

// Distances [m] of the reconstructed points, moved by the alignment of the cameras (never by one of
// their own), to the true points. A point's truth is what its first view shows: that is where its
// feature began. Points without truth are left out.
std::vector<double> PointErrors(const Reconstruction& reconstruction,
                                const Sim3& truth_from_reconstruction,
                                const PointTruth& truth);

}  // namespace cohort
