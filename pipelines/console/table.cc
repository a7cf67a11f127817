#include "pipelines/console/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "frontend/core/error.h"

namespace cohort {

namespace {

using TextRows = std::vector<std::vector<std::string>>;

constexpr std::size_t kGap = 2;  // between columns

std::vector<std::size_t> WidthsOf(const TextRows& rows) {
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()), 0);
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  }
  return widths;
}

// One row for every line of the headings.
TextRows HeadingRows(const std::vector<std::string>& headings) {
  TextRows rows;
  for (std::size_t c = 0; c < headings.size(); ++c) {
    std::istringstream lines(headings[c]);
    std::string line;
    for (std::size_t r = 0; std::getline(lines, line); ++r) {
      if (r == rows.size()) rows.emplace_back(headings.size());
      rows[r][c] = OneLine(line);
    }
  }
  return rows;
}

// A block of the table with the columns 0 .. left_columns - 1 and begin .. end - 1.
std::string Block(const TextRows& rows,
                  std::size_t heading_rows,
                  const std::vector<std::size_t>& widths,
                  std::size_t left_columns,
                  std::size_t begin,
                  std::size_t end) {
  std::string text;
  for (std::size_t r = 0; r < rows.size(); ++r) {
    std::string line;
    std::size_t rule = 0;
    for (std::size_t c = 0; c < end; ++c) {
      if (c >= left_columns && c < begin) continue;
      const std::string gap(rule > 0 ? kGap : 0, ' ');
      const std::string cell = c < rows[r].size() ? rows[r][c] : "";
      line += gap + (c < left_columns ? fmt::format("{:<{}}", cell, widths[c])
                                      : fmt::format("{:>{}}", cell, widths[c]));
      rule += gap.size() + widths[c];
    }
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
    if (r + 1 == heading_rows) text += std::string(rule, '-') + "\n";
  }
  return text;
}

}  // namespace

std::string AlignedTable(const TextRows& table, std::size_t left_columns, std::size_t max_width) {
  if (table.empty()) return "";
  TextRows rows = HeadingRows(table.front());
  const std::size_t heading_rows = rows.size();
  rows.insert(rows.end(), table.begin() + 1, table.end());
  for (std::size_t r = heading_rows; r < rows.size(); ++r) {
    for (std::string& cell : rows[r]) cell = OneLine(cell);
  }
  const std::vector<std::size_t> widths = WidthsOf(rows);
  left_columns = std::min(left_columns, widths.size());
  std::size_t left_width = 0;
  for (std::size_t c = 0; c < left_columns; ++c) left_width += widths[c] + (c > 0 ? kGap : 0);
  std::string text;
  std::size_t begin = left_columns;
  do {
    std::size_t end = begin;
    std::size_t width = left_width;
    while (end < widths.size() && (end == begin || width + kGap + widths[end] <= max_width)) {
      width += kGap + widths[end++];
    }
    if (!text.empty()) text += "\n";
    text += Block(rows, heading_rows, widths, left_columns, begin, end);
    begin = end;
  } while (begin < widths.size());
  return text;
}

TextRows WithoutEmptyColumns(const TextRows& table) {
  TextRows filled(table.size());
  for (std::size_t c = 0; c < table.front().size(); ++c) {
    const bool empty =
        std::all_of(table.begin() + 1, table.end(), [c](const auto& row) { return row[c] == "-"; });
    if (empty) continue;
    for (std::size_t r = 0; r < table.size(); ++r) filled[r].push_back(table[r][c]);
  }
  return filled;
}

}  // namespace cohort
