#include "frontend/tracks/track_csv.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <tuple>

#include "frontend/core/error.h"
#include "frontend/core/output.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHeader = "track_id,frame,x,y,observed,residual";
constexpr std::size_t kNoColumn = static_cast<std::size_t>(-1);

// Lines of a text file, one at a time; the longest allowed line bounds the memory.
class LineReader {
 public:
  explicit LineReader(const fs::path& path) : path_(path), stream_(path, std::ios::binary) {
    if (!stream_ || fs::is_directory(path)) {
      ThrowError("cannot read {}: {}",
                 path.string(),
                 fs::is_directory(path) ? "it is a folder" : std::strerror(errno));
    }
  }

  bool Next() {
    stream_.getline(buffer_.data(), static_cast<std::streamsize>(buffer_.size()));
    const auto count = static_cast<std::size_t>(stream_.gcount());
    if (stream_.bad()) ThrowError("cannot read {}: {}", path_.string(), std::strerror(errno));
    if (stream_.fail() && count == 0) return false;
    ++number_;
    if (stream_.fail()) Throw("longer than {} characters: this is no CSV", buffer_.size());
    // getline counts the line's end, except at the end of the file.
    line_ = {buffer_.data(), stream_.eof() ? count : count - 1};
    if (line_.ends_with('\r')) line_.remove_suffix(1);
    return true;
  }

  std::string_view line() const { return line_; }

  template <typename... Args>
  [[noreturn]] void Throw(fmt::format_string<Args...> text, Args&&... args) const {
    ThrowAt(number_, fmt::format(text, std::forward<Args>(args)...));
  }
  [[noreturn]] void ThrowAt(std::size_t number, const std::string& what) const {
    ThrowError("{}, line {}: {}", path_.string(), number, what);
  }

 private:
  fs::path path_;
  std::ifstream stream_;
  std::array<char, 1 << 16> buffer_;
  std::string_view line_;
  std::size_t number_ = 0;
};

std::string_view Trim(std::string_view text) {
  const auto first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t") - first + 1);
}

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
  std::vector<std::string_view> fields_;  // kept, so that a line allocates nothing
};

// Where the columns are.
struct Columns {
  std::size_t track_id, frame, x, y, observed, residual;
  std::size_t count;
};

Columns ReadHeader(const LineReader& reader) {
  std::string_view line = reader.line();
  if (line.starts_with("\xEF\xBB\xBF")) line.remove_prefix(3);  // byte order mark
  FieldSplitter splitter;
  const auto names = splitter.Split(line);
  const auto find = [&](std::string_view name, bool required) {
    const auto it = std::find(names.begin(), names.end(), name);
    if (it == names.end() && required) {
      reader.Throw(
          "there is no column {}: the first line must name the columns, as in {}", name, kHeader);
    }
    if (std::count(names.begin(), names.end(), name) > 1) {
      reader.Throw("there are two columns {}", name);
    }
    return it == names.end() ? kNoColumn : static_cast<std::size_t>(it - names.begin());
  };
  return {.track_id = find("track_id", true),
          .frame = find("frame", true),
          .x = find("x", true),
          .y = find("y", true),
          .observed = find("observed", false),
          .residual = find("residual", false),
          .count = names.size()};
}

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

double ParseFinite(const LineReader& reader, std::string_view name, std::string_view text) {
  const auto value = Parse<double>(text);
  if (!value || !std::isfinite(*value)) {
    reader.Throw(
        "{} is '{}', not a finite number; leave out rows where a track was not seen", name, text);
  }
  return *value;
}

ObservationState ParseObserved(const LineReader& reader, std::string_view text) {
  for (const std::string_view yes : {"1", "true", "True"}) {
    if (text == yes) return ObservationState::kObserved;
  }
  for (const std::string_view no : {"0", "false", "False"}) {
    if (text == no) return ObservationState::kPredicted;
  }
  reader.Throw("observed is '{}', neither 1 nor 0", text);
}

// Row r is line r + 2: a blank line is an error, except behind the last row.
std::size_t LineOfRow(std::size_t row) { return row + 2; }

// Throws on two rows of the same track and frame.
void CheckDuplicates(const LineReader& reader,
                     const std::vector<Observation>& rows,
                     const std::vector<std::uint64_t>& ids) {
  const auto key = [&](std::size_t r) { return std::pair(ids[r], rows[r].frame); };
  std::vector<std::uint32_t> order(rows.size());
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple(key(a), a) < std::tuple(key(b), b);
  });
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (key(order[i - 1]) == key(order[i])) {
      reader.ThrowAt(LineOfRow(order[i]),
                     fmt::format("track {} already has a position in frame {}, at line {}",
                                 ids[order[i]],
                                 ToInt(rows[order[i]].frame),
                                 LineOfRow(order[i - 1])));
    }
  }
}

// Text into an OutputFile, a block at a time.
class TextOutput {
 public:
  explicit TextOutput(const fs::path& path)
      : path_(path), file_(path), stream_(file_.partial(), std::ios::binary) {
    text_.reserve(kBlock + 4096);
    CheckWritten();
  }

  TextOutput& Text(std::string_view text) {
    text_ += text;
    return *this;
  }
  template <typename T>
  TextOutput& Number(T value) {
    std::array<char, 32> digits;
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
    text_.append(digits.data(), end);
    return *this;
  }
  void EndLine() {
    text_ += '\n';
    if (text_.size() >= kBlock) Flush();
  }
  void Commit() {
    Flush();
    stream_.close();
    CheckWritten();
    file_.Commit();
  }

 private:
  static constexpr std::size_t kBlock = 1 << 16;

  void Flush() {
    stream_.write(text_.data(), static_cast<std::streamsize>(text_.size()));
    text_.clear();
    CheckWritten();
  }
  void CheckWritten() const {
    if (!stream_) ThrowError("cannot write {}: {}", path_.string(), std::strerror(errno));
  }

  fs::path path_;
  OutputFile file_;
  std::ofstream stream_;
  std::string text_;
};

}  // namespace

TracksCsv ReadTracksCsv(const fs::path& path) {
  LineReader reader(path);
  if (!reader.Next()) ThrowError("{} is empty", path.string());
  const Columns columns = ReadHeader(reader);

  std::vector<Observation> rows;
  std::vector<std::uint64_t> ids;
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
    ids.push_back(ParseId<std::uint64_t>(reader, "track_id", fields[columns.track_id]));
    Observation& row = rows.emplace_back();
    row.frame = FrameIndex{ParseId<std::uint32_t>(reader, "frame", fields[columns.frame])};
    row.xy = {ParseFinite(reader, "x", fields[columns.x]),
              ParseFinite(reader, "y", fields[columns.y])};
    if (const auto text = optional(columns.observed); !text.empty()) {
      row.state = ParseObserved(reader, text);
    }
    if (const auto text = optional(columns.residual); !text.empty()) {
      row.residual = ParseFinite(reader, "residual", text);
    }
  }
  if (rows.empty()) ThrowError("{} has a header but no rows", path.string());
  if (rows.size() > std::numeric_limits<std::uint32_t>::max()) {
    ThrowError("{} has more than 2^32 rows: split it", path.string());
  }
  CheckDuplicates(reader, rows, ids);

  TracksCsv csv;
  if (*std::max_element(ids.begin(), ids.end()) > std::numeric_limits<std::uint32_t>::max()) {
    csv.track_ids = ids;
    std::sort(csv.track_ids.begin(), csv.track_ids.end());
    csv.track_ids.erase(std::unique(csv.track_ids.begin(), csv.track_ids.end()),
                        csv.track_ids.end());
    for (std::uint64_t& id : ids) {
      id = static_cast<std::uint64_t>(
          std::lower_bound(csv.track_ids.begin(), csv.track_ids.end(), id) - csv.track_ids.begin());
    }
  }
  for (std::size_t r = 0; r < rows.size(); ++r) {
    rows[r].feature = FeatureId{static_cast<std::uint32_t>(ids[r])};
  }
  csv.tracks = TrackSet::Build(std::move(rows));
  return csv;
}

void WriteTracksCsv(const fs::path& path, const TrackSet& tracks) {
  TextOutput out(path);
  out.Text(kHeader).EndLine();
  for (const Observation& o : tracks.observations()) {
    out.Number(ToInt(o.feature)).Text(",").Number(ToInt(o.frame)).Text(",");
    out.Number(o.xy.x()).Text(",").Number(o.xy.y());
    out.Text(o.state == ObservationState::kObserved ? ",1," : ",0,").Number(o.residual).EndLine();
  }
  out.Commit();
}

void WriteOpenSfmTracks(const fs::path& path, const TrackFile& file, bool include_predicted) {
  Check(file.width_px > 0 && file.height_px > 0, "the image size is known");
  const double longer_px = std::max(file.width_px, file.height_px);
  TextOutput out(path);
  out.Text("OPENSFM_TRACKS_VERSION_v2").EndLine();
  for (const FrameInfo& frame : file.frames) {
    int feature_in_image = 0;
    for (const Observation* o : file.tracks.InFrame(frame.index)) {
      if (o->state != ObservationState::kObserved && !include_predicted) continue;
      out.Text(frame.name).Text("\t").Number(ToInt(o->feature)).Text("\t");
      out.Number(feature_in_image++).Text("\t");
      out.Number((o->xy.x() + 0.5 - 0.5 * file.width_px) / longer_px).Text("\t");
      out.Number((o->xy.y() + 0.5 - 0.5 * file.height_px) / longer_px).Text("\t");
      out.Number(1.0 / longer_px).Text("\t0\t0\t0\t-1\t-1").EndLine();
    }
  }
  out.Commit();
}

}  // namespace cohort
