#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "pipelines/experiment/cells.h"
#include "pipelines/experiment/results.h"

namespace cohort {

// Adds a task's result (tasks.h) for a cell's tracks, or for a model made from them.
void AddTrackRows(const TrackCell& cell,
                  const nlohmann::ordered_json& result,
                  ExperimentResults& results);
void AddModelRows(const TrackCell& cell,
                  GridBackend backend,
                  const nlohmann::ordered_json& result,
                  ExperimentResults& results);

// Whether the task's result states that its cell is impossible.
bool IsNotAvailable(const std::filesystem::path& path);
// Whether a model's task has made one with enough frames.
bool HasModel(const nlohmann::ordered_json& result);
bool HasModel(const std::filesystem::path& result);
// Adds the result of the two halves of a cell's tracks (TrackCell::HasHalves), of which `model` was
// made; `halves` is null if they belong to another shard. If the tracks together give no model,
// their halves have failed too.
void AddHalvesRows(const TrackCell& cell,
                   GridBackend backend,
                   const nlohmann::ordered_json& model,
                   const nlohmann::ordered_json& halves,
                   ExperimentResults& results);

}  // namespace cohort
