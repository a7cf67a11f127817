#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace cohort {

inline constexpr std::size_t kMaxTableWidth = 120;

// Rows of text as aligned columns: the first `left_columns` left-aligned, the others right-aligned,
// with a rule under the first row, whose cells may have several lines ("ATE\n[mm]"). Missing cells
// at the end of a row stay empty. Columns beyond `max_width` continue below, with the left ones
// repeated.
std::string AlignedTable(const std::vector<std::vector<std::string>>& table,
                         std::size_t left_columns = 1,
                         std::size_t max_width = kMaxTableWidth);

// Removes the columns in which only the first row has a figure (other than "-").
std::vector<std::vector<std::string>> WithoutEmptyColumns(
    const std::vector<std::vector<std::string>>& table);

}  // namespace cohort
