#include "frontend/tracks/text_rows.h"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <numeric>
#include <tuple>

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBlock = 1 << 16;

}  // namespace

std::string_view Trim(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

double ParseFinite(const LineReader& reader, std::string_view name, std::string_view text) {
  const auto value = Parse<double>(text);
  if (!value || !std::isfinite(*value)) {
    reader.Throw(
        "{} is '{}', not a finite number; leave out rows where a track was not seen", name, text);
  }
  return *value;
}

Observation& TrackRows::Add(const LineReader& reader, std::uint64_t track_id) {
  if (reader.number() > std::numeric_limits<std::uint32_t>::max()) {
    ThrowError("{} has more than 2^32 rows: split it", reader.path().string());
  }
  ids_.push_back(track_id);
  lines_.push_back(static_cast<std::uint32_t>(reader.number()));
  return rows_.emplace_back();
}

void TrackRows::CheckDuplicates(const LineReader& reader) const {
  const auto key = [&](std::size_t r) { return std::pair(ids_[r], rows_[r].frame); };
  std::vector<std::uint32_t> order(rows_.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple(key(a), a) < std::tuple(key(b), b);
  });
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (key(order[i - 1]) == key(order[i])) {
      reader.ThrowAt(lines_[order[i]],
                     fmt::format("track {} already has a position in frame {}, at line {}",
                                 ids_[order[i]],
                                 ToInt(rows_[order[i]].frame),
                                 lines_[order[i - 1]]));
    }
  }
}

TrackRows::Tracks TrackRows::Build(const LineReader& reader) && {
  CheckDuplicates(reader);
  Tracks result;
  if (!ids_.empty() &&
      *std::max_element(ids_.begin(), ids_.end()) > std::numeric_limits<std::uint32_t>::max()) {
    result.track_ids = ids_;
    std::sort(result.track_ids.begin(), result.track_ids.end());
    result.track_ids.erase(std::unique(result.track_ids.begin(), result.track_ids.end()),
                           result.track_ids.end());
    for (std::uint64_t& id : ids_) {
      id = static_cast<std::uint64_t>(
          std::lower_bound(result.track_ids.begin(), result.track_ids.end(), id) -
          result.track_ids.begin());
    }
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    rows_[r].feature = FeatureId{static_cast<std::uint32_t>(ids_[r])};
  }
  result.tracks = TrackSet::Build(std::move(rows_));
  return result;
}

TextOutput::TextOutput(const fs::path& path)
    : path_(path), file_(path), stream_(file_.partial(), std::ios::binary) {
  text_.reserve(kBlock + 4096);
  CheckWritten();
}

void TextOutput::EndLine() {
  text_ += '\n';
  if (text_.size() >= kBlock) Flush();
}

void TextOutput::Commit() {
  Flush();
  stream_.close();
  CheckWritten();
  file_.Commit();
}

void TextOutput::Flush() {
  stream_.write(text_.data(), static_cast<std::streamsize>(text_.size()));
  text_.clear();
  CheckWritten();
}

void TextOutput::CheckWritten() const {
  if (!stream_) ThrowError("cannot write {}: {}", path_.string(), std::strerror(errno));
}

}  // namespace cohort
