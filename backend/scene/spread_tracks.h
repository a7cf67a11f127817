#pragma once

#include <vector>

#include "backend/scene/whitened_tracks.h"
#include "frontend/geometry/camera.h"

namespace cohort {

// The fewest long tracks that say of the cameras nearly what all do: the longest ones first, each
// that comes to a cell of the picture (8 x 6) in one of `frames` in which there are less than
// `per_cell`. Ascending.
std::vector<int> SpreadTracks(const WhitenedTracks& whitened,
                              const Camera& camera,
                              const std::vector<int>& frames,
                              int per_cell);

}  // namespace cohort
