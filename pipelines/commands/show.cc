#include "pipelines/commands/show.h"

#include <filesystem>

#include "datasets/open_sequence.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/report/clip_report.h"
#include "pipelines/report/track_video.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

void WritePageOf(const ShowOptions& options, const TrackFile& file, Sequence& sequence) {
  ClipReport report;
  if (!options.model.empty()) report = ReadClipReport(options.model);
  report.title = fs::path(file.source).filename().string();
  WriteClipReport(options.out, report, file, sequence, ProgressBars());
}

}  // namespace

void RunShow(const ShowOptions& options) {
  if (options.tracks.size() > 2) ThrowUsageError("show takes one or two .tracks files");
  std::vector<TrackFile> files;
  for (const std::string& tracks : options.tracks) files.push_back(ReadTrackFile(tracks));
  const bool is_page = fs::path(options.out).extension() == ".html";
  if (is_page && files.size() > 1) ThrowUsageError("a page shows one .tracks file: give one");
  if (!is_page && !options.model.empty()) {
    ThrowUsageError("--model is for a page: give an --out that ends in .html");
  }
  const auto sequence =
      OpenSequence(options.images.empty() ? files.front().source : options.images);
  if (is_page) {
    WritePageOf(options, files.front(), *sequence);
  } else {
    WriteTrackVideo(
        options.out, files, *sequence, options.frames_per_second, options.width_px, ProgressBars());
  }
}

Command ShowCommand() {
  return MakeCommand(
      {.name = "show",
       .usage = "F.tracks [G.tracks] --out tracks.mp4|tracks.gif|page.html [options]",
       .summary = "Show tracks as a video, or a clip and its model as a page",
       .positionals = {"tracks"},
       .required = {"tracks", "out"}},
      RunShow);
}

}  // namespace cohort
