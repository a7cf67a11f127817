#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "pipelines/experiment/cells.h"

namespace cohort {

// Metrics of the paper's tables.
inline constexpr const char* kL1ErrorMetric = "l1_error_30_frames";  // of the usual window
std::string L1ErrorMetric(int window_frames);
inline constexpr const char* kFramesBetweenMetric = "frames_between_reinitializations";
// The disagreement of the two halves of the tracks (evaluation/halves.h), and whether they failed.
inline constexpr const char* kHalvesMetric = "halves_disagreement";
inline constexpr const char* kHalvesFailedMetric = "halves_failed";

// One figure of one cell. `backend` is empty for figures of the tracks alone.
struct ResultRow {
  std::string sequence;
  std::string level;
  std::string tracker;
  std::string backend;
  unsigned seed = 0;
  std::string metric;
  double value = 0.0;
  std::string unit;
};

// A cell and why it is noted.
struct CellNote {
  std::string sequence;
  std::string level;
  std::string tracker;
  std::string backend;
  unsigned seed = 0;
  std::string reason;
};

// The results of an experiment. A failed cell has the rows `failed` = 1 and, if it got so far,
// `registered` and `frames`, but no errors: a small error of few frames is meaningless. An
// impossible cell (the ceiling without ground truth) has the row `not_available` = 1 and is not a
// failure.
struct ExperimentResults {
  std::vector<ResultRow> rows;
  std::vector<CellNote> failures;
  std::vector<CellNote> not_available;
  std::vector<TrackCell> cells;  // where tracks and models lie
};

// results.csv: header sequence,level,tracker,backend,seed,metric,value,unit. Whole or not at all.
void WriteResultsCsv(const std::filesystem::path& path, const ExperimentResults& results);
// The same with the failures' reasons, the conditions of the experiment and the headline (may be
// null).
void WriteResultsJson(const std::filesystem::path& path,
                      const ExperimentResults& results,
                      const nlohmann::ordered_json& conditions,
                      const nlohmann::ordered_json& headline);

}  // namespace cohort
