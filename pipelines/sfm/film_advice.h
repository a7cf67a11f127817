#pragma once

#include <string>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// What made a clip hard, and how to film it better: a sentence each, in words that need no
// knowledge of reconstruction; empty where all went well. `brightness`: mean intensity of each of
// the file's frames, 0..1.
std::vector<std::string> FilmAdvice(const TrackFile& file,
                                    const Reconstruction& model,
                                    const std::vector<double>& brightness);

}  // namespace cohort
