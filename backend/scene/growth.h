#pragma once

#include <vector>

#include "backend/scene/adjustment.h"

namespace cohort {

struct GrowthOptions {
  // Points that no two rays see at this angle count for nothing while the model grows; in the end
  // all do that are seen at kFarRayAngleDeg.
  double min_ray_angle_deg = kNearRayAngleDeg;
};

// Adds one keyframe after the other, always the one that sees most points: PnP from its neighbour's
// pose, triangulation, local bundle adjustment; a global one for every 30 % of growth. Where no
// keyframe can be added, plain frames next to the model; where none of those either, once more with
// everything adjusted and relaxed bounds.
void GrowModel(WorkingModel& model,
               const std::vector<int>& keyframes,
               const GrowthOptions& options);

// Poses for the frames between and beyond the keyframes, by the points that they see.
void RegisterOtherFrames(WorkingModel& model);

}  // namespace cohort
