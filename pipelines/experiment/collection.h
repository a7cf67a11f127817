#pragma once

#include "pipelines/experiment/plan.h"
#include "pipelines/experiment/results.h"

namespace cohort {

// Is the result of its tracks, or of the paper's protocol, there?
bool HasOwnResult(const ExperimentOptions& options, const TrackCell& cell);
// The rows of all cells whose results are there, of these clips and options (HasResult): those of
// other shards too.
ExperimentResults CollectResults(const ExperimentOptions& options, const ExperimentPlan& plan);

}  // namespace cohort
