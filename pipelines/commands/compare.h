#pragma once

#include "pipelines/console/command.h"
#include "pipelines/experiment/experiment.h"

namespace cohort {

// Clips x levels x seeds x trackers x backends: runs all, prints the table, writes OUT/results.csv
// and OUT/results.json.
void RunCompare(const ExperimentOptions& options);

Command CompareCommand();

}  // namespace cohort
