#pragma once

#include <optional>
#include <vector>

#include "backend/start/start_models.h"

namespace cohort {

// The best start model of the first window of frames that gives any.
struct Start {
  std::optional<StartModel> model;
  std::size_t windows_tried = 0;
};

// Tries windows between these pairs in their order; skips windows similar to one that failed.
Start FindStart(const WhitenedTracks& whitened,
                const Camera& camera,
                const std::vector<FramePairMotion>& pairs);

}  // namespace cohort
