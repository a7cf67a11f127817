#include "datasets/readers/text_table.h"

#include <charconv>
#include <cmath>
#include <utility>

#include "frontend/core/error.h"
#include "frontend/storage/line_reader.h"

namespace cohort {

TextTable::TextTable(const std::filesystem::path& file) : file_(file.string()) {
  constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 28;  // about 30 times as many in memory
  LineReader reader(file);
  if (std::filesystem::file_size(file) > kMaxBytes) {
    ThrowError("cannot read {}: tables of up to {} bytes are supported", file_, kMaxBytes);
  }
  constexpr std::string_view kSeparators = " \t,\r";
  while (reader.Next()) {
    const std::string_view text = reader.line().substr(0, reader.line().find('#'));
    Row row{reader.number(), {}};
    for (std::size_t begin = text.find_first_not_of(kSeparators); begin < text.size();) {
      const std::size_t end = std::min(text.find_first_of(kSeparators, begin), text.size());
      row.fields.emplace_back(text.substr(begin, end - begin));
      begin = text.find_first_not_of(kSeparators, end);
    }
    if (!row.fields.empty()) rows_.push_back(std::move(row));
  }
}

void TextTable::Fail(std::size_t row, std::string_view why) const {
  ThrowError("{} line {}: {}", file_, rows_[row].line, why);
}

const std::string& TextTable::Text(std::size_t row, std::size_t column) const {
  const std::vector<std::string>& fields = rows_[row].fields;
  if (column >= fields.size()) {
    Fail(row, fmt::format("it has {} fields, at least {} are needed", fields.size(), column + 1));
  }
  return fields[column];
}

template <typename T>
T TextTable::Parse(std::size_t row, std::size_t column, std::string_view kind) const {
  const std::string& text = Text(row, column);
  T value{};
  const char* const end = text.data() + text.size();
  const auto [rest, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || rest != end) Fail(row, fmt::format("'{}' is not a {}", text, kind));
  if constexpr (std::is_floating_point_v<T>) {
    if (!std::isfinite(value)) Fail(row, fmt::format("'{}' is not finite", text));
  }
  return value;
}

double TextTable::Number(std::size_t row, std::size_t column) const {
  return Parse<double>(row, column, "number");
}

std::int64_t TextTable::Integer(std::size_t row, std::size_t column) const {
  return Parse<std::int64_t>(row, column, "whole number");
}

std::int64_t TextTable::SecondsAsNs(std::size_t row, std::size_t column) const {
  // A double would round seconds since 1970 to 240 ns.
  const long double seconds = Parse<long double>(row, column, "time in seconds");
  constexpr long double kLimit = 9.2e9L;  // nanoseconds in 64 bits
  if (std::abs(seconds) > kLimit) Fail(row, "the time is beyond 292 years: give seconds");
  return std::llround(seconds * 1e9L);
}

}  // namespace cohort
