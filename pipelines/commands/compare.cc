#include "pipelines/commands/compare.h"

#include <nlohmann/json.hpp>

#include "pipelines/console/version.h"

namespace cohort {

void RunCompare(const ExperimentOptions& options) {
  const ExperimentResults results = RunExperiment(options);
  const std::filesystem::path out = options.out;
  WriteResultsCsv(out / "results.csv", results);
  WriteResultsJson(out / "results.json",
                   results,
                   {{"program", fmt::format("cohort {}", kVersion)}, {"options", ToJson(options)}});
  fmt::print("{}", ResultsTable(results));
  for (const Failure& failure : results.failures) {
    fmt::print("FAILED: {} {} {} {} seed {}: {}\n",
               failure.sequence,
               failure.level,
               failure.tracker,
               failure.backend.empty() ? "tracking" : failure.backend,
               failure.seed,
               failure.reason);
  }
}

Command CompareCommand() {
  return MakeCommand({.name = "compare",
                      .usage = "INPUT... --out DIR [options]",
                      .summary = "Compare trackers by the reconstructions made of their tracks",
                      .positionals = {"inputs"},
                      .required = {"inputs", "out"},
                      .short_flags = {{"features", {"tracking.detector.max_features"}}}},
                     RunCompare);
}

}  // namespace cohort
