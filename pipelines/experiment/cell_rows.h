#pragma once

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

}  // namespace cohort
