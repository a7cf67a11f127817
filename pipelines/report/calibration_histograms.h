#pragma once

#include <nlohmann/json_fwd.hpp>

#include "pipelines/experiment/results.h"

namespace cohort {

// For the page: histograms of the tracks' normalised errors by level and tracker, over clips and
// seeds.
nlohmann::ordered_json CalibrationHistogramsToJson(const ExperimentResults& results);

}  // namespace cohort
