#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// The frames of a clip that do not show the scene of its model, ascending: a black beginning, a
// title card, another scene after a cut. Such frames have no pose, lie at an end of the clip or of
// a piece between two cuts (TrackMeta::cuts), and share no point with the model. A still picture
// counts as a card if its tracks stay within half a pixel for five frames or more. The frames of a
// fade between it and the scene, at most 45, are part of it. Empty without a model.
std::vector<Aside> FindAsides(const TrackFile& file, const Reconstruction& model);

// The number of the clip's frames in them, including repeats.
std::size_t CountFrames(const std::vector<Aside>& asides, const TrackFile& file);

// Summarize for a model of these tracks: the frames aside do not count against it.
ReconstructionSummary SummarizeModelOf(const TrackFile& file, const Reconstruction& model);

}  // namespace cohort
