#pragma once

// Shared by readers and writers of tracks as text: one row per observation.

#include <array>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/storage/line_reader.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

std::string_view Trim(std::string_view text);

// The whole text as a number; nullopt if it is not one.
template <typename T>
std::optional<T> Parse(std::string_view text) {
  T value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

template <typename T>
T ParseId(const LineReader& reader, std::string_view name, std::string_view text) {
  const auto value = Parse<T>(text);
  if (!value) {
    reader.Throw(
        "{} is '{}', not an integer from 0 to {}", name, text, std::numeric_limits<T>::max());
  }
  return *value;
}

double ParseFinite(const LineReader& reader, std::string_view name, std::string_view text);

// Rows in the order of the file, with the ids of their tracks.
class TrackRows {
 public:
  // Adds a row for the reader's current line.
  Observation& Add(const LineReader& reader, std::uint64_t track_id);
  bool empty() const { return rows_.empty(); }

  // If an id needs more than 32 bits, ids are renumbered: FeatureId{n} then stands for
  // track_ids[n], ascending. Otherwise track_ids is empty. Throws Error on two rows of one track
  // and frame.
  struct Tracks {
    TrackSet tracks;
    std::vector<std::uint64_t> track_ids;
  };
  Tracks Build(const LineReader& reader) &&;

 private:
  void CheckDuplicates(const LineReader& reader) const;

  std::vector<Observation> rows_;
  std::vector<std::uint64_t> ids_;
  std::vector<std::uint32_t> lines_;
};

// Writes text into an OutputFile, block by block.
class TextOutput {
 public:
  explicit TextOutput(const std::filesystem::path& path);

  TextOutput& Text(std::string_view text) {
    text_ += text;
    return *this;
  }
  // With the fewest digits that read back the same.
  template <typename T>
  TextOutput& Number(T value) {
    std::array<char, 32> digits;
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    text_.append(digits.data(), end);
    return *this;
  }
  void EndLine();
  void Commit();

 private:
  void Flush();
  void CheckWritten() const;

  std::filesystem::path path_;
  OutputFile file_;
  std::ofstream stream_;
  std::string text_;
};

}  // namespace cohort
