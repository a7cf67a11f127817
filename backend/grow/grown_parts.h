#pragma once

#include <optional>
#include <vector>

#include "backend/adjust/adjustment.h"
#include "backend/grow/parts.h"
#include "backend/scene/mapper_termination.h"

namespace cohort {

// The parts of a clip, the largest first, adjusted with the given camera, or why there is none.
struct GrownParts {
  MapperEnd end = {};
  std::vector<WorkingModel> parts = {};
};

// Grows a model over the keyframes, and others over those that it leaves out.
GrownParts GrowParts(const WhitenedTracks& whitened,
                     const Camera& camera,
                     const std::vector<int>& keyframes);

// Extends the parts grown from some of the tracks to all. Returns nullopt if those do not suffice:
// they leave a keyframe without a pose or much of the parallax, or there is a seam.
std::optional<GrownParts> WithAllTracks(const WhitenedTracks& whitened,
                                        const GrownParts& by_some,
                                        const std::vector<int>& keyframes);

// Grows from some of the tracks, which takes less time, and then extends to all. Grows from all
// tracks if some do not suffice or there is a seam.
GrownParts GrowPartsBySome(const WhitenedTracks& whitened,
                           const Camera& camera,
                           const std::vector<int>& keyframes);

}  // namespace cohort
