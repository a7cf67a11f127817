#include "pipelines/commands/show.h"

#include <filesystem>

#include "datasets/open_sequence.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/report/clip_report.h"
#include "pipelines/report/track_video.h"
#include "pipelines/sfm/doubts.h"
#include "pipelines/sfm/input.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// Throws Error if the files belong to two clips, as far as they record it.
void CheckOneClip(const ShowOptions& options, const std::vector<TrackFile>& files) {
  const TrackFile& a = files.front();
  const TrackFile& b = files.back();
  if (a.width_px != b.width_px || a.height_px != b.height_px) {
    ThrowError("the tracks belong to clips of {}x{} and {}x{}: give tracks of one clip",
               a.width_px,
               a.height_px,
               b.width_px,
               b.height_px);
  }
  if (!options.images.empty()) return;  // the user has decided
  const bool both_tell = !a.meta.fingerprint.empty() && !b.meta.fingerprint.empty();
  if (both_tell ? a.meta.fingerprint == b.meta.fingerprint : a.source == b.source) return;
  if (a.source != b.source) {
    ThrowError(
        "{} was made from {}, but {} from {}: give tracks of one clip, or use --images to name the "
        "clip on which to show both",
        options.tracks.front(),
        a.source,
        options.tracks.back(),
        b.source);
  }
  ThrowError(
      "{} and {} were made from {}, which has changed in between: track it again, or use --images "
      "to name the clip on which to show both",
      options.tracks.front(),
      options.tracks.back(),
      a.source);
}

std::unique_ptr<Sequence> OpenClipOf(const ShowOptions& options, const TrackFile& file) {
  if (!options.images.empty()) return OpenSequence(options.images);
  auto sequence = OpenSource(file, options.tracks.front());
  ConsoleReport().Warn(DoubtOfClip(file, options.tracks.front(), *sequence));
  return sequence;
}

void WritePageOf(const ShowOptions& options, const TrackFile& file, Sequence& sequence) {
  ClipReport report;
  if (!options.model.empty()) {
    report = ReadClipReport(options.model);
    ConsoleReport().Warn(DoubtOfModel(report.model, options.model, file, options.tracks.front()));
  }
  report.title = sequence.Name();
  WriteClipReport(options.out, report, file, sequence, ProgressBars());
}

}  // namespace

void RunShow(const ShowOptions& options) {
  if (options.tracks.size() > 2) ThrowUsageError("show takes one or two .tracks files");
  std::vector<TrackFile> files;
  for (const std::string& tracks : options.tracks) {
    files.push_back(ReadTrackFile(tracks));
  }
  const bool is_page = fs::path(options.out).extension() == ".html";
  if (is_page && files.size() > 1) ThrowUsageError("a page shows one .tracks file: give one");
  if (!is_page && !options.model.empty()) {
    ThrowUsageError("--model is for a page: give an --out that ends in .html");
  }
  const ShowOptions defaults;
  if (is_page && (options.frames_per_second != defaults.frames_per_second ||
                  options.width_px != defaults.width_px)) {
    ThrowUsageError("--frames-per-second and --width-px are for a video: leave them out of a page");
  }
  CheckOneClip(options, files);
  CheckOutputsGiven({options.out});
  const auto sequence = OpenClipOf(options, files.front());
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
