#pragma once

#include <vector>

#include "backend/adjust/adjustment.h"

namespace cohort {

// Adds one keyframe after the other, always the one that sees the most points: PnP from its
// neighbour's pose, triangulation, local bundle adjustment, and a global one for every 30 % of
// growth. If no keyframe can be added, it adds plain frames next to the model.
void GrowModel(WorkingModel& model, const std::vector<int>& keyframes);

// Registers the frames between and beyond the keyframes by the points that they see.
void RegisterOtherFrames(WorkingModel& model);

}  // namespace cohort
