#include "pipelines/commands/import.h"

#include <spdlog/spdlog.h>

#include "frontend/tracks/track_csv.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/version.h"

namespace cohort {
namespace {

// All of the file but the tracks.
TrackFile ReadFrames(const InputOptions& input) {
  const auto sequence = OpenInput(input);
  TrackFile file;
  ProgressBar progress("import", sequence->FrameCount());
  while (const auto frame = sequence->Next()) {
    file.width_px = frame->gray.cols;
    file.height_px = frame->gray.rows;
    file.frames.push_back({frame->index, frame->name, frame->timestamp_ns});
    progress.Advance();
  }
  if (!sequence->Warning().empty()) spdlog::warn("{}", sequence->Warning());
  DescribeInput(input, *sequence, file);
  return file;
}

void CheckFramesKnown(const TrackFile& file, const std::string& csv, const std::string& input) {
  auto known = file.frames.begin();
  for (const FrameIndex frame : file.tracks.frames()) {
    while (known != file.frames.end() && known->index < frame) ++known;
    if (known == file.frames.end() || known->index != frame) {
      ThrowError("{}: frame {} is not among the {} frames read from {}",
                 csv,
                 ToInt(frame),
                 file.frames.size(),
                 input);
    }
  }
}

}  // namespace

void RunImport(const ImportCommandOptions& options) {
  TracksCsv csv = ReadTracksCsv(options.tracks);
  if (!csv.track_ids.empty()) {
    spdlog::warn("{}: track ids need more than 32 bits and are counted anew, from 0",
                 options.tracks);
  }
  TrackFile file = ReadFrames(options.input);
  file.tracks = std::move(csv.tracks);
  CheckFramesKnown(file, options.tracks, options.input.input);
  file.meta = {{"program", fmt::format("cohort {}", kVersion)},
               {"tracker", "import"},
               {"imported_from", AbsolutePath(options.tracks)},
               {"frames", options.input.frames}};
  WriteTrackFile(options.out, file);
  fmt::print("{}: {} tracks, {} observations in {} frames\n",
             options.out,
             file.tracks.features().size(),
             file.tracks.observations().size(),
             file.frames.size());
}

Command ImportCommand() {
  return MakeCommand({.name = "import",
                      .usage = "TRACKS.csv --images INPUT --out F.tracks [options]",
                      .summary = "Take over the tracks of any other tracker",
                      .positionals = {"tracks"},
                      .required = {"tracks", "input", "out"},
                      .short_flags = {{"images", {"input"}}}},
                     RunImport);
}

}  // namespace cohort
