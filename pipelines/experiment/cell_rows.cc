#include "pipelines/experiment/cell_rows.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;

class RowAdder {
 public:
  RowAdder(const TrackCell& cell, std::string_view backend, ExperimentResults& results)
      : cell_(cell), backend_(backend), results_(results) {}

  void Add(const std::string& metric, const Json& value, const std::string& unit) {
    if (value.is_null()) return;
    results_.rows.push_back({cell_.condition.clip.name,
                             cell_.condition.level,
                             cell_.tracker.name,
                             backend_,
                             cell_.condition.seed,
                             metric,
                             value.is_boolean() ? value.get<bool>() : value.get<double>(),
                             unit});
  }

  void Fail(const std::string& reason) { results_.failures.push_back(Note(reason)); }

  // A figure that is impossible for a cell is not a failure of its tracker.
  void AddNotAvailable(const std::string& reason) {
    Add("not_available", true, "");
    results_.not_available.push_back(Note(reason));
  }

 private:
  CellNote Note(const std::string& reason) const {
    return {cell_.condition.clip.name,
            cell_.condition.level,
            cell_.tracker.name,
            backend_,
            cell_.condition.seed,
            reason};
  }

  const TrackCell& cell_;
  std::string backend_;
  ExperimentResults& results_;
};

// Whether the task has figures. If not, adds rows that state why.
bool IsFinished(const Json& result, RowAdder& rows) {
  const Json& figures = result.at("figures");
  if (figures.contains("not_available")) {
    rows.AddNotAvailable(figures.at("not_available"));
    return false;
  }
  if (!result.at("error").is_null()) {
    rows.Add("failed", true, "");
    rows.Fail(result.at("error"));
    return false;
  }
  return true;
}

std::string WhyFailed(const Json& model) {
  return fmt::format("{} of {} frames registered: {}",
                     model.at("registered").get<std::size_t>(),
                     model.at("frames").get<std::size_t>(),
                     model.at("termination").get<std::string>());
}

// Protocol paper.
void AddFollowRows(const Json& figures, RowAdder& rows) {
  rows.Add("features", figures.at("features"), "");
  rows.Add(L1ErrorMetric(figures.at("window_frames")), figures.at("l1_error_px"), "px");
  rows.Add("feature_frames", figures.at("feature_frames"), "frames");
  rows.Add("reinitializations", figures.at("reinitializations"), "");
  rows.Add("lost", figures.at("lost"), "");
  rows.Add(kFramesBetweenMetric, figures.at("frames_between_reinitializations"), "frames");
  rows.Add("track_time", figures.at("ms_per_frame"), "ms/frame");
}

// Errors of tracks against the truth.
void AddErrorRows(const Json& errors, RowAdder& rows) {
  if (!errors.at("observed").is_null()) {
    rows.Add("observed_error_median", errors.at("observed").at("median_px"), "px");
    rows.Add("observed_error_p90", errors.at("observed").at("p90_px"), "px");
    rows.Add("observed_error_mean", errors.at("observed").at("mean_px"), "px");
  }
  if (!errors.at("calibration").is_null()) {
    rows.Add("nees_ratio", errors.at("calibration").at("nees_ratio"), "");
    rows.Add("normalised_error_sigma", errors.at("calibration").at("robust_sigma"), "");
  }
  rows.Add("outlier_share", errors.at("outlier_share"), "");
  rows.Add("predicted_precision", errors.at("predicted_precision"), "");
  rows.Add("predicted_recall", errors.at("predicted_recall"), "");
  rows.Add(kFramesBetweenMetric, errors.at("mean_frames_between_reinitializations"), "frames");
  rows.Add(kL1ErrorMetric, errors.at("l1_error_30_frames_px"), "px");
}

}  // namespace

bool IsNotAvailable(const std::filesystem::path& path) {
  bool not_available = false;
  UseJsonFile(path, [&not_available](const Json& result) {
    not_available = result.at("figures").contains("not_available");
  });
  return not_available;
}

void AddTrackRows(const TrackCell& cell, const Json& result, ExperimentResults& results) {
  RowAdder rows(cell, "", results);
  if (!IsFinished(result, rows)) return;
  rows.Add("failed", false, "");
  const Json& figures = result.at("figures");
  if (figures.contains("l1_error_px")) {
    AddFollowRows(figures, rows);
    return;
  }
  const Json& track = figures.at("track");
  rows.Add("tracks", track.at("tracks"), "");
  rows.Add("observations", track.at("observations"), "");
  rows.Add("predicted", track.at("predicted"), "");
  rows.Add("mean_track_length", track.at("mean_track_length"), "frames");
  if (track.contains("ms_per_frame")) {
    rows.Add("detect_time", track.at("ms_per_frame").at("detect"), "ms/frame");
    rows.Add("track_time", track.at("ms_per_frame").at("track"), "ms/frame");
  }
  if (figures.contains("errors")) AddErrorRows(figures.at("errors"), rows);
}

void AddModelRows(const TrackCell& cell,
                  GridBackend backend,
                  const Json& result,
                  ExperimentResults& results) {
  RowAdder rows(cell, NameOf(kGridBackendNames, backend), results);
  if (!IsFinished(result, rows)) return;
  const Json& figures = result.at("figures");
  const Json& model = figures.at("model");
  rows.Add("failed", model.at("failed"), "");
  rows.Add("registered", model.at("registered"), "frames");
  rows.Add("frames", model.at("frames"), "frames");
  rows.Add("seconds", model.at("seconds"), "s");
  if (model.at("failed").get<bool>()) {
    rows.Fail(WhyFailed(model));
    return;
  }
  rows.Add("points", model.at("points"), "");
  rows.Add("model_track_length", model.at("mean_track_length"), "frames");
  rows.Add("mean_reprojection", model.at("mean_reprojection_px"), "px");
  if (!figures.contains("errors")) return;
  const Json& errors = figures.at("errors");
  if (backend != GridBackend::kTriangulation) {  // which uses the true cameras
    rows.Add("ate", errors.at("ate_m"), "m");
    rows.Add("rpe_rot", errors.at("rpe_rot_deg"), "deg");
    rows.Add("rpe_trans", errors.at("rpe_trans_m"), "m");
  }
  rows.Add("point_error_median", errors.at("point_error_median_m"), "m");
  if (backend != GridBackend::kTriangulation) {
    rows.Add("auc_5", errors.at("auc_5"), "");
    rows.Add("auc_10", errors.at("auc_10"), "");
    rows.Add("auc_20", errors.at("auc_20"), "");
  }
}

bool HasModel(const Json& result) {
  return result.at("error").is_null() && result.at("figures").contains("model") &&
         !result.at("figures").at("model").at("failed").get<bool>();
}

bool HasModel(const std::filesystem::path& result) {
  bool has_model = false;
  UseJsonFile(result, [&has_model](const Json& json) { has_model = HasModel(json); });
  return has_model;
}

void AddHalvesRows(const TrackCell& cell,
                   GridBackend backend,
                   const Json& model,
                   const Json& halves,
                   ExperimentResults& results) {
  RowAdder rows(cell, NameOf(kGridBackendNames, backend), results);
  if (!HasModel(model)) {  // which is already a failure with a reason
    rows.Add(kHalvesFailedMetric, true, "");
    return;
  }
  if (halves.is_null()) return;
  if (!halves.at("error").is_null()) {
    rows.Add(kHalvesFailedMetric, true, "");
    rows.Fail(fmt::format("halves: {}", halves.at("error").get<std::string>()));
    return;
  }
  const Json& figures = halves.at("figures");
  const bool failed = figures.at("disagreement").is_null();
  rows.Add(kHalvesFailedMetric, failed, "");
  rows.Add(kHalvesMetric, figures.at("disagreement"), "");
  rows.Add("halves_frames", figures.at("frames_share"), "");
  if (!failed) return;
  for (const Json& half : figures.at("models")) {
    if (!half.at("failed").get<bool>()) continue;
    rows.Fail(fmt::format("halves: {}", WhyFailed(half)));
    return;
  }
  rows.Fail("halves: their cameras do not determine an alignment");
}

}  // namespace cohort
