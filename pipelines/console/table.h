#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace cohort {

inline constexpr std::size_t kMaxTableWidth = 120;

// Rows of text as aligned columns, the first `left_columns` to the left and the others to the
// right, a rule under the first row, whose cells may have several lines ("ATE\n[mm]"). Missing
// cells at the end of a row stay empty. Columns that do not fit into `max_width` go on below,
// beside the left ones again.
std::string AlignedTable(const std::vector<std::vector<std::string>>& table,
                         std::size_t left_columns = 1,
                         std::size_t max_width = kMaxTableWidth);

// Without the columns in which no row but the first has a figure ("-").
std::vector<std::vector<std::string>> WithoutEmptyColumns(
    const std::vector<std::vector<std::string>>& table);

}  // namespace cohort
