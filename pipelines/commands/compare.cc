#include "pipelines/commands/compare.h"

#include <nlohmann/json.hpp>

#include "pipelines/console/version.h"
#include "pipelines/experiment/paper_tables.h"

namespace cohort {

void RunCompare(const ExperimentOptions& options) {
  const ExperimentResults results = RunExperiment(options);
  const std::filesystem::path out = options.out;
  WriteResultsCsv(out / "results.csv", results);
  WriteResultsJson(out / "results.json",
                   results,
                   {{"program", fmt::format("cohort {}", kVersion)}, {"options", ToJson(options)}});
  fmt::print("{}",
             options.protocol == Protocol::kPaper ? PaperTables(results) : ResultsTable(results));
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
  return MakeCommand(
      {.name = "compare",
       .usage = "INPUT... --out DIR [options]",
       .summary =
           "Compare trackers by the reconstructions made of their tracks, or as the paper did",
       .positionals = {"inputs"},
       .required = {"inputs", "out"},
       .short_flags = {{"features", {"tracking.detector.max_features"}}}},
      RunCompare);
}

}  // namespace cohort
