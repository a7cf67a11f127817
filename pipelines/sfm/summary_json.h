#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/reconstruct.h"

namespace cohort {

// "first:end:stride", as FrameRange reads it: evaluation must know which frames are missing.
std::string RangeOf(const std::vector<FrameInfo>& frames);

// Reasons to doubt a model as files have them: [{code, sentence, figures: {name: number}}]. A figure
// that is not finite is left out: JSON has no such number.
nlohmann::ordered_json DoubtsToJson(const std::vector<Doubt>& doubts);
// And back. A sentence alone, as files of before have it, and an unknown code are DoubtCode::kOther.
// Throws what UseJsonFile makes an Error of.
std::vector<Doubt> DoubtsFromJson(const nlohmann::ordered_json& json);

// What summary.json says of any model: the summary, and which frames it was to have.
nlohmann::ordered_json SummaryToJson(const ReconstructionSummary& summary,
                                     const std::vector<FrameInfo>& frames);

// summary.json of a part of a clip beside the one that is returned: its figures among the frames of
// the clip from its first to its last, and its shutter.
nlohmann::ordered_json SummaryOfPart(const Reconstruction& part,
                                     const std::vector<FrameInfo>& frames);

// All of summary.json (docs/files.md) of a model that Reconstruct made of tracks in `frames`.
nlohmann::ordered_json SummaryToJson(const ReconstructResult& result,
                                     const std::vector<FrameInfo>& frames,
                                     const ReconstructOptions& options);

}  // namespace cohort
