#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "pipelines/report/headline.h"

namespace cohort {

// For the terminal and the README, at most 120 columns: the cohort beside the first standing rival,
// a line for every level and backend; then beside each other rival, a line for every level, backend
// and rival.
//   cameras, points, length  HeadlineRatio of each metric: the mean, (the least .. the largest
//                            seed), and "of n" where only n clips have both
//   registered               frames with a pose: of the cohort / of the rival
//   failed                   clips that failed: of the cohort / of the rival, of how many
std::string HeadlineTables(const Headline& headline);

// For results.json and the page: {cohort, main_rival, rivals, rows, runs, losses, contests} as in
// Headline.
nlohmann::ordered_json HeadlineToJson(const Headline& headline);

}  // namespace cohort
