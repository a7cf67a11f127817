#include "pipelines/commands/compare.h"

#include <nlohmann/json.hpp>

#include "frontend/storage/write_lock.h"
#include "pipelines/console/messages.h"
#include "pipelines/experiment/collection.h"
#include "pipelines/experiment/paper_tables.h"
#include "pipelines/report/headline_output.h"
#include "pipelines/report/report.h"
#include "pipelines/report/results_tables.h"
#include "pipelines/sfm/version.h"

namespace cohort {
namespace {

void PrintNotes(const char* what, const std::vector<CellNote>& notes) {
  for (const CellNote& note : notes) {
    PrintLine("{}: {} {} {} {} seed {}: {}",
              what,
              note.sequence,
              note.level,
              note.tracker,
              note.backend.empty() ? "tracking" : note.backend,
              note.seed,
              note.reason);
  }
}

}  // namespace

void RunCompare(const ExperimentOptions& options) {
  const ExperimentPlan plan = RunCells(options);
  const std::filesystem::path out = options.out;
  // Shards may end at the same time; the last one to write includes the results of all others.
  const WriteLock lock = WriteLock::Await(out / "cells" / "results.lock");
  const ExperimentResults results = CollectResults(options, plan);
  const auto headline = MakeHeadline(results);
  WriteResultsCsv(out / "results.csv", results);
  WriteResultsJson(out / "results.json",
                   results,
                   {{"program", fmt::format("cohort {}", kVersion)}, {"options", ToJson(options)}},
                   headline ? HeadlineToJson(*headline) : nlohmann::ordered_json(nullptr));
  if (options.protocol == Protocol::kPaper) {
    fmt::print("{}", PaperTables(results, options.paper.window_frames));
  } else {
    WriteReport(out / "report.html", results, options);
    fmt::print("{}", ResultsTables(results));
    if (headline) fmt::print("\n{}", HeadlineTables(*headline));
  }
  PrintNotes("FAILED", results.failures);
  PrintNotes("not available", results.not_available);
}

Command CompareCommand() {
  return MakeCommand({.name = "compare",
                      .usage = "INPUT... --out DIR [options]",
                      .summary = "Compare trackers by the reconstructions made from their tracks, "
                                 "or by the paper's protocol",
                      .positionals = {"inputs"},
                      .required = {"inputs", "out"},
                      .short_flags = {{"features", {"tracking.detector.max_features"}},
                                      {"colmap-program", {"colmap.program"}}}},
                     RunCompare);
}

}  // namespace cohort
