#include "frontend/tracks/track_csv.h"

#include <algorithm>
#include <span>
#include <string>
#include <string_view>

#include "frontend/core/error.h"
#include "frontend/tracks/text_rows.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kColumns = "track_id,frame,x,y,observed,residual";
constexpr std::size_t kNoColumn = static_cast<std::size_t>(-1);
constexpr std::string_view kOccluded = "occluded";
constexpr std::string_view kObservedNames[] = {"observed", "visible", "visibility", kOccluded};

// Splits at commas that are not within double quotes; quotes around a field are dropped.
class FieldSplitter {
 public:
  std::span<const std::string_view> Split(std::string_view line) {
    fields_.clear();
    bool quoted = false;
    std::size_t begin = 0;
    for (std::size_t i = 0; i <= line.size(); ++i) {
      if (i < line.size() && line[i] == '"') quoted = !quoted;
      if (i < line.size() && (line[i] != ',' || quoted)) continue;
      std::string_view field = Trim(line.substr(begin, i - begin));
      if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
        field = field.substr(1, field.size() - 2);
      }
      fields_.push_back(field);
      begin = i + 1;
    }
    return fields_;
  }

 private:
  std::vector<std::string_view> fields_;  // kept, so that no line allocates memory
};

// The positions of the columns.
struct Columns {
  std::size_t track_id, frame, x, y, residual;
  std::size_t observed;
  std::string_view observed_name;  // of kObservedNames
  std::size_t count;
};

Columns ReadHeader(const LineReader& reader) {
  FieldSplitter splitter;
  const auto names = splitter.Split(reader.line());
  const auto find = [&](std::string_view name, bool required) {
    const auto it = std::find(names.begin(), names.end(), name);
    if (it == names.end() && required) {
      reader.Throw(
          "there is no column {}: the first line must name the columns, as in {}", name, kColumns);
    }
    if (std::count(names.begin(), names.end(), name) > 1) {
      reader.Throw("there are two columns {}", name);
    }
    return it == names.end() ? kNoColumn : static_cast<std::size_t>(it - names.begin());
  };
  Columns columns{.track_id = find("track_id", true),
                  .frame = find("frame", true),
                  .x = find("x", true),
                  .y = find("y", true),
                  .residual = find("residual", false),
                  .observed = kNoColumn,
                  .observed_name = {},
                  .count = names.size()};
  for (const std::string_view name : kObservedNames) {
    columns.observed = find(name, false);
    columns.observed_name = name;
    if (columns.observed != kNoColumn) break;
  }
  return columns;
}

bool ParseFlag(const LineReader& reader, std::string_view name, std::string_view text) {
  for (const std::string_view yes : {"1", "true", "True"}) {
    if (text == yes) return true;
  }
  for (const std::string_view no : {"0", "false", "False"}) {
    if (text == no) return false;
  }
  if (name == kObservedNames[0]) reader.Throw("observed is '{}', neither 1 nor 0", text);
  return ParseFinite(reader, name, text) >= 0.5;
}

ObservationState ParseObserved(const LineReader& reader,
                               std::string_view name,
                               std::string_view text) {
  const bool is_observed = ParseFlag(reader, name, text) != (name == kOccluded);
  return is_observed ? ObservationState::kObserved : ObservationState::kPredicted;
}

}  // namespace

TracksCsv ReadTracksCsv(const fs::path& path) {
  LineReader reader(path);
  if (!reader.Next()) ThrowError("{} is empty", path.string());
  const Columns columns = ReadHeader(reader);

  TrackRows rows;
  FieldSplitter splitter;
  while (reader.Next()) {
    if (Trim(reader.line()).empty()) {
      while (reader.Next()) {
        if (!Trim(reader.line()).empty()) reader.Throw("there is a blank line before this row");
      }
      break;
    }
    const auto fields = splitter.Split(reader.line());
    if (fields.size() != columns.count) {
      reader.Throw("{} fields, but the first line names {}", fields.size(), columns.count);
    }
    const auto optional = [&](std::size_t column) {
      return column == kNoColumn ? std::string_view() : fields[column];
    };
    Observation& row =
        rows.Add(reader, ParseId<std::uint64_t>(reader, "track_id", fields[columns.track_id]));
    row.frame = FrameIndex{ParseId<std::uint32_t>(reader, "frame", fields[columns.frame])};
    row.xy = {ParseFinite(reader, "x", fields[columns.x]),
              ParseFinite(reader, "y", fields[columns.y])};
    if (const auto text = optional(columns.observed); !text.empty()) {
      row.state = ParseObserved(reader, columns.observed_name, text);
    }
    if (const auto text = optional(columns.residual); !text.empty()) {
      row.residual = ParseFinite(reader, "residual", text);
    }
  }
  if (rows.empty()) ThrowError("{} has a header but no rows", path.string());
  TrackRows::Tracks tracks = std::move(rows).Build(reader);
  return {std::move(tracks.tracks), std::move(tracks.track_ids)};
}

void WriteTracksCsv(const fs::path& path, const TrackSet& tracks) {
  TextOutput out(path);
  out.Text(kColumns).EndLine();
  for (const Observation& o : tracks.observations()) {
    out.Number(ToInt(o.feature)).Text(",").Number(ToInt(o.frame)).Text(",");
    out.Number(o.xy.x()).Text(",").Number(o.xy.y());
    out.Text(o.state == ObservationState::kObserved ? ",1," : ",0,").Number(o.residual).EndLine();
  }
  out.Commit();
}

}  // namespace cohort
