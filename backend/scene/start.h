#pragma once

#include <vector>

#include "backend/scene/start_models.h"

namespace cohort {

// The start models of the first window of frames that gives any.
struct Start {
  std::vector<StartModel> models;  // best first; empty: no window gave one
  std::size_t windows_tried = 0;
};

// Tries windows between these pairs, in their order; one much like one that failed is left out.
Start FindStart(const WhitenedTracks& whitened,
                const Camera& camera,
                const std::vector<FramePairMotion>& pairs);

// The best start that is another scene than the first (depths differ by more than a similarity) and
// that the window cannot tell from it; null: none.
StartModel* FindRival(std::vector<StartModel>& models);

// Whether a truncated cost is larger than another by more than noise (of a whitened coordinate)
// would make it.
bool IsWorse(double larger_cost, double cost, double noise);

}  // namespace cohort
