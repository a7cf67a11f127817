#pragma once

#include <filesystem>

#include "pipelines/experiment/experiment.h"
#include "pipelines/experiment/results.h"

namespace cohort {

// report.html: one page that opens offline, for a reader who knows nothing of the project. What was
// run, who won where and by how much, error against darkness, the tracks over a dark frame, two
// reconstructions in 3-D, whether the covariances are right, every cell, every failure. The same
// results make the same bytes: no date, no times. Whole or not at all.
void WriteReport(const std::filesystem::path& path,
                 const ExperimentResults& results,
                 const ExperimentOptions& options);

}  // namespace cohort
