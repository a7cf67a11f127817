#include "pipelines/experiment/results.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <tuple>

#include "frontend/core/output.h"
#include "frontend/core/statistics.h"
#include "pipelines/console/table.h"
#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

std::string QuoteCsv(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

using Line = std::tuple<std::string, std::string, std::string, std::string>;  // without the seed
using ValuesOfMetric = std::map<std::string, std::vector<double>>;            // over seeds

std::optional<double> MedianOf(const ValuesOfMetric& values, const std::string& metric) {
  const auto it = values.find(metric);
  if (it == values.end()) return std::nullopt;
  return InterpolatedMedian(it->second);
}

std::string Cell(const std::optional<double>& value, double factor, int decimals) {
  if (!value) return "-";
  return std::isinf(*value) ? "failed" : fmt::format("{:.{}f}", *value * factor, decimals);
}

std::string Registered(const ValuesOfMetric& model) {
  const auto registered = MedianOf(model, "registered");
  const std::string text =
      registered
          ? fmt::format("{:.0f}/{:.0f}", *registered, MedianOf(model, "frames").value_or(0.0))
          : "-";
  const auto it = model.find("failed");
  if (it == model.end()) return "not available";
  const auto& failed = it->second;
  const auto failures = std::count(failed.begin(), failed.end(), 1.0);
  if (failures == 0) return text;
  if (failed.size() == 1) return "FAILED " + text;
  return fmt::format("FAILED {} of {}, {}", failures, failed.size(), text);
}

std::vector<std::string> TableRow(const Line& line,
                                  const ValuesOfMetric& model,
                                  const ValuesOfMetric& tracks) {
  const auto& [sequence, level, tracker, backend] = line;
  return {sequence,
          level,
          tracker,
          backend,
          Registered(model),
          Cell(MedianOf(model, "ate"), 1e3, 2),
          Cell(MedianOf(model, "ate_to_undegraded"), 1e3, 2),
          Cell(MedianOf(model, kHalvesMetric), 1e2, 2),
          Cell(MedianOf(model, "halves_frames"), 1e2, 0),
          Cell(MedianOf(model, "rpe_rot"), 1.0, 3),
          Cell(MedianOf(model, "point_error_median"), 1e3, 1),
          Cell(MedianOf(model, "points"), 1.0, 0),
          Cell(MedianOf(model, "mean_reprojection"), 1.0, 2),
          Cell(MedianOf(tracks, "mean_track_length"), 1.0, 1),
          Cell(MedianOf(tracks, "observed_error_median"), 1.0, 2),
          Cell(MedianOf(tracks, "observed_error_p90"), 1.0, 2)};
}

nlohmann::ordered_json ToJson(const CellNote& note) {
  return {{"sequence", note.sequence},
          {"level", note.level},
          {"tracker", note.tracker},
          {"backend", note.backend},
          {"seed", note.seed},
          {"reason", note.reason}};
}

}  // namespace

void WriteResultsCsv(const std::filesystem::path& path, const ExperimentResults& results) {
  std::string text = "sequence,level,tracker,backend,seed,metric,value,unit\n";
  for (const ResultRow& row : results.rows) {
    text += fmt::format("{},{},{},{},{},{},{},{}\n",
                        QuoteCsv(row.sequence),
                        QuoteCsv(row.level),
                        QuoteCsv(row.tracker),
                        row.backend,
                        row.seed,
                        row.metric,
                        row.value,
                        row.unit);
  }
  OutputFile out(path);
  WriteBytes(out.partial(), text);
  out.Commit();
}

void WriteResultsJson(const std::filesystem::path& path,
                      const ExperimentResults& results,
                      const nlohmann::ordered_json& conditions) {
  nlohmann::ordered_json json{{"conditions", conditions},
                              {"failures", nlohmann::ordered_json::array()},
                              {"not_available", nlohmann::ordered_json::array()},
                              {"rows", nlohmann::ordered_json::array()}};
  for (const CellNote& failure : results.failures) json["failures"].push_back(ToJson(failure));
  for (const CellNote& note : results.not_available) {
    json["not_available"].push_back(ToJson(note));
  }
  for (const ResultRow& row : results.rows) {
    json["rows"].push_back({{"sequence", row.sequence},
                            {"level", row.level},
                            {"tracker", row.tracker},
                            {"backend", row.backend},
                            {"seed", row.seed},
                            {"metric", row.metric},
                            {"value", row.value},
                            {"unit", row.unit}});
  }
  WriteJsonFile(path, json);
}

std::string ResultsTable(const ExperimentResults& results) {
  std::vector<Line> order;
  std::map<Line, ValuesOfMetric> values;
  for (const ResultRow& row : results.rows) {
    const Line line{row.sequence, row.level, row.tracker, row.backend};
    if (!row.backend.empty() && !values.contains(line)) order.push_back(line);
    values[line][row.metric].push_back(row.value);
    if (row.metric == kHalvesFailedMetric && row.value != 0.0) {
      values[line][kHalvesMetric].push_back(std::numeric_limits<double>::infinity());
    }
  }
  std::vector<std::vector<std::string>> table{{"sequence",
                                               "level",
                                               "tracker",
                                               "backend",
                                               "registered",
                                               "ATE [mm]",
                                               "to undegraded [mm]",
                                               "halves [%]",
                                               "in both [%]",
                                               "rotation [deg]",
                                               "point error [mm]",
                                               "points",
                                               "reprojection [px]",
                                               "length",
                                               "track error [px]",
                                               "90 % [px]"}};
  for (const Line& line : order) {
    const auto& [sequence, level, tracker, backend] = line;
    table.push_back(TableRow(line, values[line], values[Line{sequence, level, tracker, ""}]));
  }
  return AlignedTable(WithoutEmptyColumns(table), 4);
}

}  // namespace cohort
