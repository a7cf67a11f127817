#pragma once

#include <optional>

#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// The share of the observations, of tracks of ten frames or more, that no static world explains:
// those of tracks without a point in half of their frames, whose best point leaves a median error
// of 0.25 % of the picture's diagonal. nullopt without a model or such tracks. An object that moves
// uniformly beside the camera looks like a point elsewhere and does not count.
std::optional<double> MovingShare(const TrackFile& file, const Reconstruction& model);

}  // namespace cohort
