#pragma once

#include "pipelines/console/command.h"
#include "pipelines/experiment/experiment.h"

namespace cohort {

// Runs clips x levels x seeds x trackers x backends, prints the table, writes OUT/results.csv and
// OUT/results.json.
void RunCompare(const ExperimentOptions& options);

Command CompareCommand();

}  // namespace cohort
