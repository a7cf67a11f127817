#pragma once

#include <filesystem>

#include "pipelines/experiment/experiment.h"
#include "pipelines/experiment/results.h"

namespace cohort {

// report.html: one page that opens offline, for readers who do not know the project. It shows what
// was run, the best tracker of each clip and its margin, error against darkness, the tracks over a
// dark frame, two reconstructions in 3-D, whether the covariances are right, every cell, every
// failure. Equal results give equal bytes: no date, no times. Whole or not at all.
void WriteReport(const std::filesystem::path& path,
                 const ExperimentResults& results,
                 const ExperimentOptions& options);

}  // namespace cohort
