#include "pipelines/report/report.h"

#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "datasets/degrade/degrade.h"
#include "frontend/storage/output.h"
#include "pipelines/report/calibration_histograms.h"
#include "pipelines/report/headline_output.h"
#include "pipelines/report/report_page.h"
#include "pipelines/report/shown_models.h"
#include "pipelines/report/shown_tracks.h"
#include "pipelines/sfm/version.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Times depend on the machine rather than on the trackers.
const std::set<std::string> kTimes{"seconds", "detect_time", "track_time"};

Json RowsOf(const ExperimentResults& results) {
  Json rows = Json::array();
  for (const ResultRow& row : results.rows) {
    if (kTimes.contains(row.metric)) continue;
    rows.push_back(
        {row.sequence, row.level, row.tracker, row.backend, row.seed, row.metric, row.value});
  }
  return rows;
}

Json NotesOf(const std::vector<CellNote>& notes) {
  Json list = Json::array();
  for (const CellNote& note : notes) {
    list.push_back({note.sequence, note.level, note.tracker, note.backend, note.seed, note.reason});
  }
  return list;
}

// The effect of a level on the frames, and its position on the axis of darkness (none for as-is and
// other recipes).
Json LevelOf(const std::string& level) {
  if (level == kAsIs) return {{"name", level}, {"about", "the clips as they are"}};
  if (const RecipeLevel* const other = FindRecipeLevel(level)) {
    const SensorLevel sensor = SensorLevelAt(ParseLevel(other->level), other->light);
    return {{"name", level},
            {"about",
             fmt::format("a camera sensor at {:.2g} % of the light: photon and read noise, gain, "
                         "motion blur{}",
                         100.0 * sensor.gain,
                         other->recipe == DegradeRecipe::kPhone
                             ? "; then a phone's denoising, exposure in steps and H.264"
                             : "")}};
  }
  const PaperLevel paper = PaperLevelAt(ParseLevel(level));
  std::string about = fmt::format("{:.0f} % of the light, noise of {:.1f} % of the full range",
                                  100.0 * paper.gain,
                                  100.0 * paper.noise_before);
  if (paper.blur_px > 0.0) {
    about += fmt::format(
        ", blur of {:.1f} px, noise of {:.1f} % again", paper.blur_px, 100.0 * paper.noise_after);
  }
  return {{"name", level}, {"darkness", ParseLevel(level)}, {"about", about}};
}

// Makes an illustration, without which the page is still complete.
template <typename Make>
Json Illustration(const char* what, const Make& make) {
  try {
    return make();
  } catch (const Error& error) {
    spdlog::warn("report without {}: {}", what, error.what());
    return nullptr;
  }
}

Json DataOf(const ExperimentResults& results, const ExperimentOptions& options) {
  const auto headline = MakeHeadline(results);
  std::set<std::string> seen;
  Json sequences = Json::array();
  for (const TrackCell& cell : results.cells) {
    const GridClip& clip = cell.condition.clip;
    if (!seen.insert(clip.name).second) continue;
    sequences.push_back({{"name", clip.name},
                         {"has_poses", clip.has_poses},
                         {"has_track_truth", clip.has_track_truth}});
  }
  Json trackers = Json::array();
  for (const TrackCell& cell : results.cells) {
    if (cell.condition.folder != results.cells.front().condition.folder) break;
    trackers.push_back(cell.tracker.name);
  }
  Json levels = Json::array();
  for (const std::string& level : options.levels) levels.push_back(LevelOf(level));
  Json data{{"program", fmt::format("cohort {}", kVersion)},
            {"sequences", sequences},
            {"levels", levels},
            {"trackers", trackers},
            {"backends", options.backends},
            {"seeds", options.seeds},
            {"frames", options.frames},
            {"features", options.tracking.detector.max_features},
            {"headline", headline ? HeadlineToJson(*headline) : Json(nullptr)},
            {"rows", RowsOf(results)},
            {"failures", NotesOf(results.failures)},
            {"not_available", NotesOf(results.not_available)},
            {"calibration",
             Illustration("calibration", [&] { return CalibrationHistogramsToJson(results); })}};
  const std::vector<const TrackCell*> shown = ShowcaseCells(results);
  if (shown.empty()) return data;
  data["pictures"] = Illustration("pictures", [&] { return TrackPicturesToJson(shown); });
  data["models"] = Illustration("models", [&] { return ModelsToJson(results, shown, headline); });
  return data;
}

}  // namespace

void WriteReport(const fs::path& path,
                 const ExperimentResults& results,
                 const ExperimentOptions& options) {
  WritePage(path, kReportPage, DataOf(results, options));
}

}  // namespace cohort
