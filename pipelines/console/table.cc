#include "pipelines/console/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

namespace cohort {

std::string AlignedTable(const std::vector<std::vector<std::string>>& rows,
                         std::size_t left_columns) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  }
  std::string text;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    std::string line;
    for (std::size_t c = 0; c < rows[r].size(); ++c) {
      if (c > 0) line += "  ";
      line += c < left_columns ? fmt::format("{:<{}}", rows[r][c], widths[c])
                               : fmt::format("{:>{}}", rows[r][c], widths[c]);
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
    if (r == 0) {
      const std::size_t rule = std::accumulate(widths.begin(), widths.end(), std::size_t{0});
      text +=
          std::string(rule + 2 * (widths.size() - std::min<std::size_t>(widths.size(), 1)), '-');
      text += "\n";
    }
  }
  return text;
}

std::vector<std::vector<std::string>> WithoutEmptyColumns(
    const std::vector<std::vector<std::string>>& table) {
  std::vector<std::vector<std::string>> filled(table.size());
  for (std::size_t c = 0; c < table.front().size(); ++c) {
    const bool empty =
        std::all_of(table.begin() + 1, table.end(), [c](const auto& row) { return row[c] == "-"; });
    if (empty) continue;
    for (std::size_t r = 0; r < table.size(); ++r) filled[r].push_back(table[r][c]);
  }
  return filled;
}

}  // namespace cohort
