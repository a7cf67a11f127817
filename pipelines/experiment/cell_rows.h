#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "pipelines/experiment/cells.h"
#include "pipelines/experiment/results.h"

namespace cohort {

// Adds what a task has written (tasks.h) of a cell's tracks, or of a model made of them.
void AddTrackRows(const TrackCell& cell,
                  const nlohmann::ordered_json& result,
                  ExperimentResults& results);
void AddModelRows(const TrackCell& cell,
                  GridBackend backend,
                  const nlohmann::ordered_json& result,
                  ExperimentResults& results);

// Is what a task has written that its cell cannot have any?
bool IsNotAvailable(const std::filesystem::path& path);
// Has the task of a model made one of enough frames?
bool HasModel(const nlohmann::ordered_json& result);
bool HasModel(const std::filesystem::path& result);
// Adds what has come of the two halves of a cell's tracks (TrackCell::HasHalves), of which `model`
// was made; `halves` is null where they are another shard's. Halves of tracks that make no model
// together have failed too.
void AddHalvesRows(const TrackCell& cell,
                   GridBackend backend,
                   const nlohmann::ordered_json& model,
                   const nlohmann::ordered_json& halves,
                   ExperimentResults& results);

}  // namespace cohort
