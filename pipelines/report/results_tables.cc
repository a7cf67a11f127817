#include "pipelines/report/results_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <tuple>

#include "frontend/core/statistics.h"
#include "pipelines/console/table.h"

namespace cohort {
namespace {

using Line = std::tuple<std::string, std::string, std::string, std::string>;  // without the seed
using ValuesOfMetric = std::map<std::string, std::vector<double>>;            // over seeds
using TextRows = std::vector<std::vector<std::string>>;

struct Column {
  const char* heading;  // with the unit below
  const char* metric;
  double factor;
  int decimals;
  bool is_error = false;  // infinite for a failed seed
};
constexpr Column kModelColumns[] = {{"ATE\n[mm]", "ate", 1e3, 2, true},
                                    {"to undegraded\n[mm]", "ate_to_undegraded", 1e3, 2, true},
                                    {"halves\n[%]", kHalvesMetric, 1e2, 2},
                                    {"in both\n[%]", "halves_frames", 1e2, 0},
                                    {"rotation\n[deg]", "rpe_rot", 1.0, 3, true},
                                    {"point error\n[mm]", "point_error_median", 1e3, 1, true},
                                    {"points", "points", 1.0, 0},
                                    {"reprojection\n[px]", "mean_reprojection", 1.0, 2, true}};
constexpr Column kTrackColumns[] = {{"length", "mean_track_length", 1.0, 1},
                                    {"track error\n[px]", "observed_error_median", 1.0, 2},
                                    {"90 %\n[px]", "observed_error_p90", 1.0, 2}};

std::optional<double> MedianOf(const ValuesOfMetric& values, const std::string& metric) {
  const auto it = values.find(metric);
  if (it == values.end()) return std::nullopt;
  return InterpolatedMedian(it->second);
}

std::string CellText(const ValuesOfMetric& values, const Column& column) {
  const auto value = MedianOf(values, column.metric);
  if (!value) return "-";
  return std::isinf(*value) ? "failed"
                            : fmt::format("{:.{}f}", *value * column.factor, column.decimals);
}

std::string Registered(const ValuesOfMetric& model) {
  const auto registered = MedianOf(model, "registered");
  std::string text =
      registered ? fmt::format("{:g}/{:g}", *registered, MedianOf(model, "frames").value_or(0.0))
                 : "-";
  const auto it = model.find("failed");
  if (it == model.end()) return "not available";
  const auto& failed = it->second;
  const auto failures = std::count(failed.begin(), failed.end(), 1.0);
  if (failures == 0) return text;
  if (failed.size() == 1) return "FAILED " + text;
  return fmt::format("FAILED {} of {}, {}", failures, failed.size(), text);
}

// The lines in their order of appearance: those with a backend, or those of the tracks alone.
std::vector<Line> LinesOf(const ExperimentResults& results, bool with_backend) {
  std::vector<Line> lines;
  for (const ResultRow& row : results.rows) {
    const Line line{row.sequence, row.level, row.tracker, row.backend};
    if (row.backend.empty() == with_backend) continue;
    if (std::find(lines.begin(), lines.end(), line) == lines.end()) lines.push_back(line);
  }
  return lines;
}

std::map<Line, ValuesOfMetric> ValuesByLine(const ExperimentResults& results) {
  std::map<Line, ValuesOfMetric> values;
  for (const ResultRow& row : results.rows) {
    ValuesOfMetric& of_line = values[Line{row.sequence, row.level, row.tracker, row.backend}];
    of_line[row.metric].push_back(row.value);
    if (row.metric == kHalvesFailedMetric && row.value != 0.0) {
      of_line[kHalvesMetric].push_back(std::numeric_limits<double>::infinity());
    }
  }
  // A failed seed has an infinite error, as in ResultIndex::Median.
  for (auto& [line, of_line] : values) {
    const auto failed = of_line.find("failed");
    if (failed == of_line.end()) continue;
    const auto failures = std::count(failed->second.begin(), failed->second.end(), 1.0);
    for (const Column& column : kModelColumns) {
      const auto it = of_line.find(column.metric);
      if (!column.is_error || it == of_line.end()) continue;
      it->second.insert(it->second.end(), failures, std::numeric_limits<double>::infinity());
    }
  }
  return values;
}

TextRows ModelRows(const std::vector<Line>& lines, std::map<Line, ValuesOfMetric>& values) {
  TextRows table{{"sequence", "level", "tracker", "backend", "registered"}};
  for (const Column& column : kModelColumns) table.front().push_back(column.heading);
  for (const Line& line : lines) {
    const auto& [sequence, level, tracker, backend] = line;
    table.push_back({sequence, level, tracker, backend, Registered(values[line])});
    for (const Column& column : kModelColumns) {
      table.back().push_back(CellText(values[line], column));
    }
  }
  return table;
}

// Without trackers that have no figure, such as COLMAP's own features.
TextRows TrackRows(const std::vector<Line>& lines, std::map<Line, ValuesOfMetric>& values) {
  TextRows table{{"sequence", "level", "tracker"}};
  for (const Column& column : kTrackColumns) table.front().push_back(column.heading);
  for (const Line& line : lines) {
    const bool has_figures =
        std::any_of(std::begin(kTrackColumns), std::end(kTrackColumns), [&](const Column& column) {
          return values[line].contains(column.metric);
        });
    if (!has_figures) continue;
    const auto& [sequence, level, tracker, backend] = line;
    table.push_back({sequence, level, tracker});
    for (const Column& column : kTrackColumns) {
      table.back().push_back(CellText(values[line], column));
    }
  }
  return table;
}

}  // namespace

std::string ResultsTables(const ExperimentResults& results) {
  std::map<Line, ValuesOfMetric> values = ValuesByLine(results);
  const TextRows models = ModelRows(LinesOf(results, true), values);
  const TextRows tracks = TrackRows(LinesOf(results, false), values);
  std::string text = AlignedTable(WithoutEmptyColumns(models), 4);
  if (tracks.size() == 1) return text;
  return fmt::format("{}\n{}", text, AlignedTable(WithoutEmptyColumns(tracks), 3));
}

}  // namespace cohort
