#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "pipelines/experiment/cells.h"

namespace cohort {

// Metrics that the paper's tables are made of.
inline constexpr const char* kL1ErrorMetric = "l1_error_30_frames";
inline constexpr const char* kFramesBetweenMetric = "frames_between_reinitializations";
// How far the two halves of the tracks disagree (evaluation/halves.h), and whether they failed to.
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

// What an experiment has measured. A failed cell has the rows `failed` = 1 and, where it came so
// far, `registered` and `frames`, and none of errors: a small error of few frames means nothing.
// One that cannot be (the ceiling where there is no truth) has the row `not_available` = 1 and is
// no failure.
struct ExperimentResults {
  std::vector<ResultRow> rows;
  std::vector<CellNote> failures;
  std::vector<CellNote> not_available;
  std::vector<TrackCell> cells;  // where tracks and models lie
};

// results.csv: header sequence,level,tracker,backend,seed,metric,value,unit. Whole or not at all.
void WriteResultsCsv(const std::filesystem::path& path, const ExperimentResults& results);
// The same with the failures' reasons and the conditions of the experiment.
void WriteResultsJson(const std::filesystem::path& path,
                      const ExperimentResults& results,
                      const nlohmann::ordered_json& conditions);

// A line for every sequence, level, tracker and backend in their order of appearance, marked FAILED
// where a cell did. Errors are medians over the seeds that did not fail:
//   registered        frames with a pose, of all
//   ATE               rmse of camera centres after the Sim(3) alignment with the truth
//   to undegraded     the same against the reconstruction of the undegraded frames (undegraded.h)
//   halves            clips without true cameras: how far the camera paths of two halves of the
//                     tracks disagree, share of the path's extent (evaluation/halves.h); halves
//                     that failed, together or by themselves, are infinitely apart in the median
//   in both           frames that both halves registered, of all
//   rotation          rmse of the relative rotation of neighbouring frames
//   point error       median distance to the true surface point, after that alignment
//   reprojection      mean over the model's observations: no error, but what the model admits to
//   length            mean number of frames in which the image confirmed a track
//   track error, 90 % median and 90th percentile of the confirmed positions' distance to the truth
std::string ResultsTable(const ExperimentResults& results);

}  // namespace cohort
