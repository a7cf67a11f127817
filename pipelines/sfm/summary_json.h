#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// What summary.json says of any model: the summary, and which frames it was to have.
nlohmann::ordered_json SummaryToJson(const ReconstructionSummary& summary,
                                     const std::vector<FrameInfo>& frames);

}  // namespace cohort
