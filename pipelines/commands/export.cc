#include "pipelines/commands/export.h"

#include <spdlog/spdlog.h>

#include <optional>

#include "backend/adjust/rolling_shutter.h"
#include "backend/colmap/database.h"
#include "backend/colmap/keypoint_covariances.h"
#include "backend/mapper/mapper.h"
#include "backend/scene/bal.h"
#include "frontend/storage/input_record.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/opensfm_tracks.h"
#include "frontend/tracks/track_csv.h"
#include "frontend/tracks/track_npz.h"
#include "pipelines/console/messages.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/sfm/doubts.h"
#include "pipelines/sfm/reconstruct.h"
#include "pipelines/sfm/video_frames.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// Called before the inputs are read. Inspecting the output must not make it an input, so it is
// forgotten.
void CheckHoldsNoDescriptors(const std::string& database) {
  if (!fs::is_regular_file(database) || InputRecord::Holds(database)) return;
  const std::int64_t images = CountDescribedImages(database);
  InputRecord::Forget(database);
  if (images == 0) return;
  ThrowError(
      "{} has features of {} images with descriptors, which COLMAP has extracted: give another "
      "name, or remove it",
      database,
      images);
}

void ExportColmapDatabase(TrackFile file,
                          const ExportCommandOptions& options,
                          const std::optional<Reconstruction>& model) {
  fs::path images = file.image_root;
  const bool from_files = !file.image_root.empty() || !file.source.empty();
  if (file.image_root.empty() && from_files && options.write_frames) {
    ConsoleReport().Warn(DoubtOfVideo(file, options.tracks));
    images = fs::path(options.colmap_database).replace_extension("");
    images += "_images";
    WriteVideoFrames(file, images, ProgressBars());
  }
  FocalScales focal_scale;
  if (model && !model->focal_scale.empty()) {
    focal_scale = model->focal_scale;
    Camera camera = model->camera;  // to which the scales belong
    camera.known = file.KnowsCamera();
    file.camera = camera;
  }
  WriteColmapDatabase(options.colmap_database, file, options.database, focal_scale);
  const std::string with =
      images.empty() ? "" : fmt::format(" with --image_path {}", images.string());
  PrintLine("{}: for COLMAP{}", options.colmap_database, with);
}

TrackFile TracksToExport(TrackFile file,
                         const ExportCommandOptions& options,
                         const std::optional<Reconstruction>& given) {
  if (file.tracks.observations().empty()) {
    spdlog::warn("{} has no observations: there is nothing to export", options.tracks);
  }
  if (given) ConsoleReport().Warn(DoubtOfModel(*given, options.model, file, options.tracks));
  if (!options.global_shutter) return file;
  const Reconstruction model =
      given ? *given : ReconstructWithCeres(file, {.covariances = false}).reconstruction;
  if (model.readout == 0.0) {
    spdlog::warn("{}: no rolling shutter is known; the positions are written unchanged",
                 options.model.empty() ? options.tracks : options.model);
  }
  return AsGlobalShutter(std::move(file), model);
}

}  // namespace

void RunExport(const ExportCommandOptions& options) {
  if (options.colmap_database.empty() && options.csv.empty() && options.npz.empty() &&
      options.opensfm.empty() && options.covariances.empty() && options.bal.empty()) {
    ThrowUsageError(
        "nothing to export: give --colmap-database, --csv, --npz, --opensfm, --covariances or "
        "--bal and a file");
  }
  if (!options.bal.empty() && options.model.empty()) {
    ThrowUsageError("--bal needs cameras and points: give their folder by --model");
  }
  CheckDistinctOutputs({{"--colmap-database", options.colmap_database},
                        {"--csv", options.csv},
                        {"--npz", options.npz},
                        {"--covariances", options.covariances},
                        {"--opensfm", options.opensfm},
                        {"--bal", options.bal}});
  CheckHoldsNoDescriptors(options.colmap_database);
  std::optional<Reconstruction> model;
  if (!options.model.empty()) model = ReadModelFolder(options.model);
  TrackFile read = ReadTrackFile(options.tracks);
  CheckOutputsGiven({options.colmap_database,
                     options.csv,
                     options.npz,
                     options.covariances,
                     options.opensfm,
                     options.bal});
  const TrackFile file = TracksToExport(std::move(read), options, model);
  if (model && options.global_shutter) MoveViewsToTracks(file.tracks, 0.0, *model);
  if (!options.colmap_database.empty()) ExportColmapDatabase(file, options, model);
  if (!options.csv.empty()) {
    WriteTracksCsv(options.csv, file.tracks);
    PrintLine("{}: {} rows", options.csv, file.tracks.observations().size());
  }
  if (!options.npz.empty()) {
    WriteTracksNpz(options.npz, file);
    PrintLine("{}: {} frames x {} tracks",
              options.npz,
              file.frames.size(),
              file.tracks.features().size());
  }
  if (!options.covariances.empty()) {
    const CovarianceCounts counts =
        WriteKeypointCovariances(options.covariances, file, options.database);
    PrintLine("{}: covariances of {} of {} keypoints",
              options.covariances,
              counts.keypoints - counts.without,
              counts.keypoints);
  }
  if (!options.opensfm.empty()) {
    const std::size_t tracks = WriteOpenSfmTracks(options.opensfm, file);
    PrintLine("{}: {} tracks", options.opensfm, tracks);
  }
  if (!options.bal.empty()) {
    if (model->readout != 0.0 && !options.global_shutter) {
      spdlog::warn(
          "{}: it has a rolling shutter, which BAL cannot represent: give --global-shutter",
          options.model);
    }
    WriteBal(options.bal, *model);
    PrintLine("{}: {} cameras, {} points",
              options.bal,
              model->cam_from_world.size(),
              model->points.size());
  }
}

Command ExportCommand() {
  return MakeCommand({.name = "export",
                      .usage = "F.tracks [--colmap-database F.db] [--covariances F.npz] "
                               "[--csv F.csv] [--npz F.npz] [--opensfm F.csv] "
                               "[--model DIR --bal F.txt] [options]",
                      .summary = "Export tracks to the formats of other programs",
                      .positionals = {"tracks"},
                      .required = {"tracks"}},
                     RunExport);
}

}  // namespace cohort
