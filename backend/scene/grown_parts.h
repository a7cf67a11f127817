#pragma once

#include <optional>
#include <vector>

#include "backend/scene/adjustment.h"
#include "backend/scene/mapper_termination.h"
#include "backend/scene/parts.h"

namespace cohort {

// The parts of a clip, the largest first, adjusted by the camera given; or why there is none.
struct GrownParts {
  MapperEnd end = {};
  std::vector<MappedPart> parts = {};
};

// By far points too and, where those are many, by near ones alone as well (kNearRayAngleDeg): the
// parts whose largest fits the tracks better.
GrownParts GrowPartsBothWays(const WhitenedTracks& whitened,
                             const Camera& camera,
                             const std::vector<int>& keyframes);

// What some of the clip's tracks gave, with all of them; none where some are not enough: they leave a
// keyframe without a pose, a doubt, or much of the parallax, or there is a seam.
std::optional<GrownParts> WithAllTracks(const WhitenedTracks& whitened,
                                        const GrownParts& by_some,
                                        const std::vector<int>& keyframes);

// Grown by some of the tracks, which takes so much less time, and then with all of them; where some
// are not enough, or there is a seam, by all.
GrownParts GrowPartsBySome(const WhitenedTracks& whitened,
                           const Camera& camera,
                           const std::vector<int>& keyframes);

}  // namespace cohort
