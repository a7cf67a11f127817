#include "pipelines/commands/export.h"

#include "frontend/tracks/track_csv.h"
#include "pipelines/commands/video_frames.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

void ExportColmapDatabase(const TrackFile& file, const ExportCommandOptions& options) {
  WriteColmapDatabase(options.colmap_database, file, options.database);
  fs::path images = file.image_root;
  if (file.image_root.empty() && options.write_frames) {
    images = fs::path(options.colmap_database).replace_extension("");
    images += "_images";
    WriteVideoFrames(file, images);
  }
  fmt::print("{}: for COLMAP with --image_path {}\n", options.colmap_database, images.string());
}

}  // namespace

void RunExport(const ExportCommandOptions& options) {
  if (options.colmap_database.empty() && options.csv.empty() && options.opensfm.empty()) {
    ThrowUsageError("nothing to export: give --colmap-database, --csv or --opensfm and a file");
  }
  const TrackFile file = ReadTrackFile(options.tracks);
  if (!options.colmap_database.empty()) ExportColmapDatabase(file, options);
  if (!options.csv.empty()) {
    WriteTracksCsv(options.csv, file.tracks);
    fmt::print("{}: {} rows\n", options.csv, file.tracks.observations().size());
  }
  if (!options.opensfm.empty()) {
    WriteOpenSfmTracks(options.opensfm, file, options.database.include_predicted);
    fmt::print("{}: {} tracks\n", options.opensfm, file.tracks.features().size());
  }
}

Command ExportCommand() {
  return MakeCommand(
      {.name = "export",
       .usage = "F.tracks [--colmap-database F.db] [--csv F.csv] [--opensfm F.csv] [options]",
       .summary = "Write tracks as other programs read them",
       .positionals = {"tracks"},
       .required = {"tracks"},
       .short_flags = {{"include-predicted", {"database.include_predicted"}}}},
      RunExport);
}

}  // namespace cohort
