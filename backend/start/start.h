#pragma once

#include <vector>

#include "backend/start/start_models.h"

namespace cohort {

// The start models of the first window of frames that gives any.
struct Start {
  std::vector<StartModel> models;  // best first; empty if no window gave one
  std::size_t windows_tried = 0;
};

// Tries windows between these pairs in their order; skips windows similar to one that failed.
Start FindStart(const WhitenedTracks& whitened,
                const Camera& camera,
                const std::vector<FramePairMotion>& pairs);

// The best start that shows another scene than the first (depths differ by more than a similarity)
// and that the window does not distinguish from it; null if there is none.
StartModel* FindRival(std::vector<StartModel>& models);

// Whether a truncated cost exceeds another by more than noise (of a whitened coordinate) explains.
bool IsWorse(double larger_cost, double cost, double noise);

}  // namespace cohort
