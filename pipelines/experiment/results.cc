#include "pipelines/experiment/results.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "frontend/storage/output.h"
#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

std::string QuoteCsv(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
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

std::string L1ErrorMetric(int window_frames) {
  return fmt::format("l1_error_{}_frames", window_frames);
}

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
                      const nlohmann::ordered_json& conditions,
                      const nlohmann::ordered_json& headline) {
  nlohmann::ordered_json json{{"conditions", conditions},
                              {"headline", headline},
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

}  // namespace cohort
