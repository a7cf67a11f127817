#pragma once

#include <string>
#include <vector>

namespace cohort {

// Rows of text as aligned columns, the first column to the left and the others to the right, a rule
// under the first row. Missing cells at the end of a row stay empty.
std::string AlignedTable(const std::vector<std::vector<std::string>>& rows);

}  // namespace cohort
