#pragma once

#include "pipelines/experiment/plan.h"
#include "pipelines/experiment/results.h"

namespace cohort {

// The rows of all cells whose results are there: those of other shards too.
ExperimentResults CollectResults(const ExperimentPlan& plan);

}  // namespace cohort
