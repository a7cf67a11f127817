#include "pipelines/commands/sfm.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipelines/console/messages.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"
#include "pipelines/jobs/sfm_job.h"
#include "pipelines/report/clip_report.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

void PrintFigures(const SfmFigures& figures, const std::string& out) {
  std::vector<std::vector<std::string>> rows{
      {"scene", out},
      {"frames with a pose",
       fmt::format("{} of {}", figures.model.registered, figures.model.SceneFrames())},
      {"pictures of the scene", fmt::format("{}", figures.images)},
      {"points of the scene",
       figures.points_added == 0 ? fmt::format("{}", figures.points)
                                 : fmt::format("{}, of which {} of the tracks and {} added",
                                               figures.points,
                                               figures.points - figures.points_added,
                                               figures.points_added)}};
  if (!figures.quality.empty()) rows.push_back({"quality", figures.quality});
  if (figures.expected_error) {
    rows.push_back(
        {"expected error of the cameras",
         fmt::format("{:.2g} % of the extent of their path", 100.0 * *figures.expected_error)});
  }
  if (figures.focal_px && figures.focal_sigma_px) {
    rows.push_back({"focal length found",
                    fmt::format("{:.0f} +- {:.0f} px",
                                *figures.focal_px,
                                std::max(1.0, std::ceil(*figures.focal_sigma_px)))});
  }
  rows.push_back({"report", (fs::path(out) / "report.html").string()});
  fmt::print("{}", AlignedTable(rows));
  for (const std::string& note : figures.notes) PrintLine("Left out: {}", note);
  for (const Doubt& reason : figures.reasons) PrintLine("Doubt: {}", reason.sentence);
  for (const std::string& advice : figures.film_better) PrintLine("To film better: {}", advice);
}

// Writes SCENE/report.html, unless it already belongs to this scene.
void WriteSceneReport(const SfmJobOptions& options, const SfmFigures& figures) {
  const fs::path folder = options.out;
  const fs::path page = folder / "report.html";
  if (fs::exists(page)) return;  // RunSfmJob has removed any other scene's
  ClipReport report = ReadClipReport(folder / "model");
  report.sentences.insert(report.sentences.end(), figures.notes.begin(), figures.notes.end());
  report.sentences.insert(
      report.sentences.end(), figures.film_better.begin(), figures.film_better.end());
  const auto sequence = OpenInput(options.input);
  report.title = sequence->Name();
  WriteClipReport(page, report, ReadTrackFile(folder / "clip.tracks"), *sequence, ProgressBars());
}

void RunSfm(const SfmJobOptions& options) {
  const SfmFigures figures = RunSfmJob(options);
  WriteSceneReport(options, figures);
  PrintFigures(figures, options.out);
  if (figures.model.Failed()) {
    ThrowError("the reconstruction failed: {} ({}); see the advice on filming above and in {}",
               figures.model.WhyFailed(),
               figures.model.termination,
               (fs::path(options.out) / "report.html").string());
  }
}

}  // namespace

Command SfmCommand() {
  return MakeCommand(
      {.name = "sfm",
       .usage = "INPUT --out SCENE [options]",
       .summary = "From a video to a scene: tracks, cameras, points, undistorted pictures",
       .positionals = {"input"},
       .required = {"input", "out"},
       .short_flags = {{"features", {"track.detector.max_features"}},
                       {"second-pass", {"second_pass.mode"}},
                       {"backend", {"model.backend"}},
                       {"colmap-program", {"model.colmap.program"}}}},
      RunSfm);
}

}  // namespace cohort
