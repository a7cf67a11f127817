#pragma once

#include <filesystem>
#include <map>
#include <optional>

#include "frontend/geometry/rigid3.h"
#include "frontend/tracks/observation.h"

namespace cohort {

// Camera error [m] of a model of degraded frames against a model of the same undegraded frames, for
// real clips, whose recorded ground truth is often worse than a reconstruction in good light. It is
// the root mean square distance of the camera centres after the best similarity alignment, in
// metres because the reference is first aligned with the truth `true_cam_from_world` of its frames.
// Frames are paired by their position in the clip. Returns nullopt if a model is missing or
// registered fewer than 80 % of its frames, or if the cameras determine no alignment.
std::optional<double> ErrorToUndegraded(const std::filesystem::path& model,
                                        const std::filesystem::path& reference,
                                        const std::map<FrameIndex, Rigid3>& true_cam_from_world);

}  // namespace cohort
