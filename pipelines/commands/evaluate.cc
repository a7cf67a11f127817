#include "pipelines/commands/evaluate.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "pipelines/console/table.h"
#include "pipelines/evaluation/evaluate.h"
#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;

void AddRows(const Json& json,
             const std::string& prefix,
             std::vector<std::vector<std::string>>& rows) {
  for (const auto& [key, value] : json.items()) {
    const std::string name = prefix + key;
    if (value.contains("median_px")) {
      rows.push_back({name,
                      fmt::format("{:.3f} / {:.3f} ({})",
                                  value["median_px"].get<double>(),
                                  value["p90_px"].get<double>(),
                                  value["count"].get<std::size_t>())});
    } else if (value.is_object()) {
      AddRows(value,
              name + (key == "predicted" ? ", hidden for frames: "
                      : key == "hidden"  ? " for frames: "
                                         : ": "),
              rows);
    } else if (value.is_array() || key == "histogram_sigmas") {
      continue;  // a histogram, and the width of its bins
    } else if (value.is_number_float()) {
      rows.push_back({name, fmt::format("{:.4g}", value.get<double>())});
    } else {
      rows.push_back({name,
                      value.is_null()     ? "-"
                      : value.is_string() ? value.get<std::string>()
                                          : JsonLine(value)});
    }
  }
}

void RunEvaluate(const EvaluateOptions& options) {
  const Json figures = Evaluate(options);
  std::vector<std::vector<std::string>> rows{
      {std::filesystem::is_directory(options.subject)
           ? "figure"
           : "figure (of positions: median / 90 % [px] (count))",
       options.subject}};
  AddRows(figures, "", rows);
  fmt::print("{}", AlignedTable(rows));
  if (figures.value("failed", false)) {
    spdlog::warn("{}: {}: its errors are not meaningful",
                 options.subject,
                 figures.at("why_failed").get<std::string>());
  }
}

}  // namespace

Command EvaluateCommand() {
  return MakeCommand({.name = "evaluate",
                      .usage = "F.tracks|DIR --truth INPUT [options]",
                      .summary = "Measure tracks or a model against the truth",
                      .positionals = {"subject"},
                      .required = {"subject", "truth"}},
                     RunEvaluate);
}

}  // namespace cohort
