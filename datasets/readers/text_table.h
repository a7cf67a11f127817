#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace cohort {

// A text file of rows of fields, such as the layouts' lists, poses and csv files. Fields are
// separated by blanks, tabs or commas, `#` begins a comment, and lines may have Windows endings.
// Every function throws Error naming the file and, if there is one, the line.
class TextTable {
 public:
  explicit TextTable(const std::filesystem::path& file);

  std::size_t rows() const { return rows_.size(); }  // without empty ones
  std::size_t columns(std::size_t row) const { return rows_[row].fields.size(); }

  const std::string& Text(std::size_t row, std::size_t column) const;
  double Number(std::size_t row, std::size_t column) const;  // finite
  std::int64_t Integer(std::size_t row, std::size_t column) const;
  // Seconds as in 1305031102.175304 or 1.036e-01, to the nanosecond.
  std::int64_t SecondsAsNs(std::size_t row, std::size_t column) const;

  // Throws "FILE line N: why".
  [[noreturn]] void Fail(std::size_t row, std::string_view why) const;

 private:
  struct Row {
    std::size_t line = 0;  // counted from 1
    std::vector<std::string> fields;
  };

  template <typename T>
  T Parse(std::size_t row, std::size_t column, std::string_view kind) const;

  std::string file_;
  std::vector<Row> rows_;
};

}  // namespace cohort
