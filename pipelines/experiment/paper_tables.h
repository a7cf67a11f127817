#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipelines/experiment/paper_protocol.h"
#include "pipelines/experiment/results.h"

namespace cohort {

// The paper's two tables for each level: a line for every tracker, a column for every sequence, and
// their average. A cell is the median over the seeds and, with several seeds, (lowest-highest); the
// average is that of the medians. In the second table ">" marks cells without re-initialisation:
// the value is a lower bound. Two more tables give the ratio by which `subspace` is better: the
// median over the seeds, and for the average the ratio of averages; a line "klt, best window" is
// the best klt variant for each sequence.
std::string PaperTables(const ExperimentResults& results,
                        int window_frames = PaperProtocolOptions().window_frames);

// A tracker's average in these tables, or that over some of their sequences; nullopt if a figure is
// missing.
std::optional<double> AverageOf(const ExperimentResults& results,
                                const std::string& level,
                                const std::string& metric,
                                const std::string& tracker,
                                const std::vector<std::string>& sequences = {});

// The ratio of these averages, a's over b's; nullopt if either is missing.
std::optional<double> RatioOfAverages(const ExperimentResults& results,
                                      const std::string& level,
                                      const std::string& metric,
                                      const std::string& a,
                                      const std::string& b);

// The number of sequences on which `tracker` has a smaller L1 error than all `others`.
int SequencesWon(const ExperimentResults& results,
                 const std::string& level,
                 const std::string& tracker,
                 const std::vector<std::string>& others);

}  // namespace cohort
