#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipelines/experiment/paper_protocol.h"
#include "pipelines/experiment/results.h"

namespace cohort {

// The paper's two tables of each level: a line for every tracker, a column for every sequence, and
// their average. A cell is the median over the seeds and, of several seeds, (lowest-highest);
// the average is that of the medians. In the second table ">" marks what had no re-initialisation:
// so many frames at least. Two more tables say how many times better `subspace-fused` is, or else
// `subspace`: the median over the seeds, and for the average the ratio of averages; a line "klt,
// best window" is the best for each sequence among several of klt.
std::string PaperTables(const ExperimentResults& results,
                        int window_frames = PaperProtocolOptions().window_frames);

// A tracker's average in these tables, or that over some of their sequences; none where a figure is
// missing.
std::optional<double> AverageOf(const ExperimentResults& results,
                                const std::string& level,
                                const std::string& metric,
                                const std::string& tracker,
                                const std::vector<std::string>& sequences = {});

// Of these averages, a's over b's; none where either is missing.
std::optional<double> RatioOfAverages(const ExperimentResults& results,
                                      const std::string& level,
                                      const std::string& metric,
                                      const std::string& a,
                                      const std::string& b);

// On how many sequences `tracker` has a smaller L1 error than every one of `others`.
int SequencesWon(const ExperimentResults& results,
                 const std::string& level,
                 const std::string& tracker,
                 const std::vector<std::string>& others);

}  // namespace cohort
