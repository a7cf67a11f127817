#include "pipelines/experiment/cell_rows.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

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

  // What a cell cannot have is no failure of its tracker.
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

// Protocol paper.
void AddFollowRows(const Json& figures, RowAdder& rows) {
  rows.Add("features", figures["features"], "");
  rows.Add(kL1ErrorMetric, figures["l1_error_px"], "px");
  rows.Add("feature_frames", figures["feature_frames"], "frames");
  rows.Add("reinitializations", figures["reinitializations"], "");
  rows.Add("lost", figures["lost"], "");
  rows.Add(kFramesBetweenMetric, figures["frames_between_reinitializations"], "frames");
  rows.Add("track_time", figures["ms_per_frame"], "ms/frame");
}

// Of tracks against the truth.
void AddErrorRows(const Json& errors, RowAdder& rows) {
  if (!errors["observed"].is_null()) {
    rows.Add("observed_error_median", errors["observed"]["median_px"], "px");
    rows.Add("observed_error_p90", errors["observed"]["p90_px"], "px");
    rows.Add("observed_error_mean", errors["observed"]["mean_px"], "px");
  }
  if (!errors["calibration"].is_null()) {
    rows.Add("nees_ratio", errors["calibration"]["nees_ratio"], "");
    rows.Add("normalised_error_sigma", errors["calibration"]["robust_sigma"], "");
  }
  rows.Add("outlier_share", errors["outlier_share"], "");
  rows.Add("predicted_precision", errors["predicted_precision"], "");
  rows.Add("predicted_recall", errors["predicted_recall"], "");
  rows.Add(kFramesBetweenMetric, errors["mean_frames_between_reinitializations"], "frames");
  rows.Add(kL1ErrorMetric, errors["l1_error_30_frames_px"], "px");
}

}  // namespace

void AddTrackRows(const TrackCell& cell, const Json& result, ExperimentResults& results) {
  RowAdder rows(cell, "", results);
  const Json& figures = result["figures"];
  if (figures.contains("not_available")) {
    rows.AddNotAvailable(figures["not_available"]);
    return;
  }
  rows.Add("failed", !result["error"].is_null(), "");
  if (!result["error"].is_null()) {
    rows.Fail(result["error"]);
    return;
  }
  if (figures.contains("l1_error_px")) {
    AddFollowRows(figures, rows);
    return;
  }
  const Json& track = figures["track"];
  rows.Add("tracks", track["tracks"], "");
  rows.Add("observations", track["observations"], "");
  rows.Add("predicted", track["predicted"], "");
  rows.Add("mean_track_length", track["mean_track_length"], "frames");
  if (track.contains("ms_per_frame")) {
    rows.Add("detect_time", track["ms_per_frame"]["detect"], "ms/frame");
    rows.Add("track_time", track["ms_per_frame"]["track"], "ms/frame");
  }
  if (figures.contains("errors")) AddErrorRows(figures["errors"], rows);
}

void AddModelRows(const TrackCell& cell,
                  GridBackend backend,
                  const Json& result,
                  ExperimentResults& results) {
  RowAdder rows(cell, NameOf(kGridBackendNames, backend), results);
  const Json& figures = result["figures"];
  if (figures.contains("not_available")) {
    rows.AddNotAvailable(figures["not_available"]);
    return;
  }
  if (!result["error"].is_null()) {
    rows.Add("failed", true, "");
    rows.Fail(result["error"]);
    return;
  }
  const Json& model = figures["model"];
  rows.Add("failed", model["failed"], "");
  rows.Add("registered", model["registered"], "frames");
  rows.Add("frames", model["frames"], "frames");
  rows.Add("seconds", model["seconds"], "s");
  if (model["failed"].get<bool>()) {
    rows.Fail(fmt::format("{} of {} frames registered: {}",
                          model["registered"].get<std::size_t>(),
                          model["frames"].get<std::size_t>(),
                          model["termination"].get<std::string>()));
    return;
  }
  rows.Add("points", model["points"], "");
  rows.Add("model_track_length", model["mean_track_length"], "frames");
  rows.Add("mean_reprojection", model["mean_reprojection_px"], "px");
  if (figures.contains("track_errors")) {
    rows.Add("mean_track_length", figures["track_errors"]["mean_track_length"], "frames");
    AddErrorRows(figures["track_errors"], rows);
  }
  if (!figures.contains("errors")) return;
  const Json& errors = figures["errors"];
  if (backend != GridBackend::kTriangulation) {  // whose cameras are the truth
    rows.Add("ate", errors["ate_m"], "m");
    rows.Add("rpe_rot", errors["rpe_rot_deg"], "deg");
    rows.Add("rpe_trans", errors["rpe_trans_m"], "m");
  }
  rows.Add("point_error_median", errors["point_error_median_m"], "m");
  if (backend != GridBackend::kTriangulation) {
    rows.Add("auc_5", errors["auc_5"], "");
    rows.Add("auc_10", errors["auc_10"], "");
    rows.Add("auc_20", errors["auc_20"], "");
  }
}

}  // namespace cohort
