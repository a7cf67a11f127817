#pragma once

#include <vector>

#include "backend/adjust/adjustment.h"

namespace cohort {

struct GrowthOptions {
  // While the model grows, points whose largest ray angle is smaller do not count. At the end the
  // bound is kFarRayAngleDeg.
  double min_ray_angle_deg = kNearRayAngleDeg;
};

// Adds one keyframe after the other, always the one that sees most points: PnP from its neighbour's
// pose, triangulation, local bundle adjustment, and a global one for every 30 % of growth. If no
// keyframe can be added, it adds plain frames next to the model. If that fails too, it tries once
// more with everything adjusted and relaxed bounds.
void GrowModel(WorkingModel& model,
               const std::vector<int>& keyframes,
               const GrowthOptions& options);

// Registers the frames between and beyond the keyframes by the points that they see.
void RegisterOtherFrames(WorkingModel& model);

}  // namespace cohort
