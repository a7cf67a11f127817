#pragma once

#include "pipelines/experiment/plan.h"
#include "pipelines/experiment/results.h"

namespace cohort {

// Whether the result of its tracks, or of the paper's protocol, exists.
bool HasOwnResult(const ExperimentOptions& options, const TrackCell& cell);
// The rows of all cells with results for these clips and options (HasResult), including those of
// other shards.
ExperimentResults CollectResults(const ExperimentOptions& options, const ExperimentPlan& plan);

}  // namespace cohort
