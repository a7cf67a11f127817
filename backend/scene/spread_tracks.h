#pragma once

#include <vector>

#include "backend/scene/whitened_tracks.h"
#include "frontend/geometry/camera.h"

namespace cohort {

// A small set of long tracks that constrain the cameras nearly as well as all. Takes the longest
// first, each that visits a cell of the picture (8 x 6) with fewer than `per_cell` tracks in one of
// `frames`. Ascending.
std::vector<int> SpreadTracks(const WhitenedTracks& whitened,
                              const Camera& camera,
                              const std::vector<int>& frames,
                              int per_cell = 2);

}  // namespace cohort
