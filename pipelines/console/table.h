#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace cohort {

// Rows of text as aligned columns, the first `left_columns` to the left and the others to the
// right, a rule under the first row. Missing cells at the end of a row stay empty.
std::string AlignedTable(const std::vector<std::vector<std::string>>& rows,
                         std::size_t left_columns = 1);

// Without the columns in which no row but the first has a figure ("-").
std::vector<std::vector<std::string>> WithoutEmptyColumns(
    const std::vector<std::vector<std::string>>& table);

}  // namespace cohort
