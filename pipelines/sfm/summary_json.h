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

// The reasons to doubt a model in their file format: [{code, sentence, figures: {name: number}}].
// Figures that are not finite are left out, because JSON cannot represent them.
nlohmann::ordered_json DoubtsToJson(const std::vector<Doubt>& doubts);
// The reverse. An unknown code gives DoubtCode::kOther.
// Throws exceptions that UseJsonFile turns into an Error.
std::vector<Doubt> DoubtsFromJson(const nlohmann::ordered_json& json);

// The entry `asides` of a summary.json; empty if there is none. Throws as DoubtsFromJson.
std::vector<Aside> AsidesOf(const nlohmann::ordered_json& summary);

// The part of summary.json common to all models: the summary, and which frames were requested.
nlohmann::ordered_json SummaryToJson(const ReconstructionSummary& summary,
                                     const std::vector<FrameInfo>& frames);

// summary.json of another part of a clip than the returned one: its figures for the frames of the
// clip from its first to its last, and its shutter.
nlohmann::ordered_json SummaryOfPart(const Reconstruction& part,
                                     const std::vector<FrameInfo>& frames);

// All of summary.json (docs/files.md) for a model that Reconstruct made of tracks in `frames`.
nlohmann::ordered_json SummaryToJson(const ReconstructResult& result,
                                     const std::vector<FrameInfo>& frames,
                                     const ReconstructOptions& options);

}  // namespace cohort
