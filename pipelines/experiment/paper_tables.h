#pragma once

#include <string>

#include "pipelines/experiment/results.h"

namespace cohort {

// The paper's two tables of each level: a line for every tracker, a column for every sequence, and
// their average. A cell is the median over the seeds and, of several seeds, (lowest-highest);
// the average is that of the medians. In the second table ">" marks what had no re-initialisation:
// so many frames at least. Two more tables say how many times better `subspace` is, if it is there:
// the median over the seeds, and for the average the ratio of averages; a line "klt, best window"
// is the best for each sequence among several of klt.
std::string PaperTables(const ExperimentResults& results);

}  // namespace cohort
