#include "pipelines/commands/import.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <nlohmann/json.hpp>

#include "backend/colmap/colmap_tracks.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/opensfm_tracks.h"
#include "frontend/tracks/track_csv.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/messages.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/doubts.h"
#include "pipelines/sfm/version.h"

namespace cohort {
namespace {

// Everything in the file except the tracks.
TrackFile ReadClip(const InputOptions& input) {
  const auto sequence = OpenInput(input);
  TrackFile file = ReadFrames(*sequence, "import", ProgressBars());
  if (!sequence->Warning().empty()) spdlog::warn("{}", sequence->Warning());
  DescribeInput(input, *sequence, file);
  ConsoleReport().Warn(DoubtOfCamera(file.camera));
  return file;
}

void CheckFramesKnown(const TrackSet& tracks,
                      const TrackFile& file,
                      const std::string& csv,
                      const std::string& input) {
  auto known = file.frames.begin();
  for (const FrameIndex frame : tracks.frames()) {
    while (known != file.frames.end() && known->index < frame) ++known;
    if (known == file.frames.end() || known->index != frame) {
      const bool from_one = ToInt(frame) == ToInt(file.frames.back().index) + 1 &&
                            tracks.InFrame(file.frames.front().index).empty();
      ThrowError("{}: frame {} is not among the {} frames read from {}{}",
                 csv,
                 ToInt(frame),
                 file.frames.size(),
                 input,
                 from_one ? ": frames count from 0, not from 1" : "");
    }
  }
}

// The format of a file, from its first bytes.
TracksForm FormOf(const std::string& path) {
  if (std::filesystem::is_directory(path)) return TracksForm::kColmap;
  std::array<char, 4096> start{};
  std::ifstream in = OpenInputFile(path);
  in.read(start.data(), start.size());
  const std::string_view text(start.data(), static_cast<std::size_t>(in.gcount()));
  if (text.starts_with("PK\x03\x04") || text.starts_with("\x93NUMPY")) return TracksForm::kNpz;
  if (text.starts_with("SQLite format 3")) return TracksForm::kColmap;
  const std::string_view first_line = text.substr(0, text.find('\n'));
  const bool opensfm = first_line.starts_with("OPENSFM_TRACKS_VERSION") ||
                       (std::count(first_line.begin(), first_line.end(), '\t') >= 7 &&
                        first_line.find(',') == std::string_view::npos);
  return opensfm ? TracksForm::kOpensfm : TracksForm::kCsv;
}

ImportedTracks ReadCsv(const ImportCommandOptions& options, const TrackFile& file) {
  TracksCsv csv = ReadTracksCsv(options.tracks);
  ConsoleReport().Warn(DoubtOfIds(csv, options.tracks));
  ImportedTracks imported;
  imported.tracks = std::move(csv.tracks);
  CheckFramesKnown(imported.tracks, file, options.tracks, options.input.input);
  return imported;
}

// A database, or the folder of a model.
ImportedTracks ReadColmap(const ImportCommandOptions& options, const TrackFile& file) {
  const bool is_model = std::filesystem::is_directory(options.tracks);
  ImportedTracks imported =
      is_model
          ? TracksOfColmapModel(ReadColmapModel(options.tracks), file.frames, options.tracks)
          : TracksOfColmapDatabase(ReadColmapDatabase(options.tracks), file.frames, options.tracks);
  if (imported.camera->width_px != file.width_px || imported.camera->height_px != file.height_px) {
    ThrowError(
        "{} was made from pictures of {} x {}, but {} has {} x {}: give the images that COLMAP had",
        options.tracks,
        imported.camera->width_px,
        imported.camera->height_px,
        options.input.input,
        file.width_px,
        file.height_px);
  }
  if (imported.left_out > 0) {
    spdlog::warn("{}: {} {} a point two positions in one image, and are left out",
                 options.tracks,
                 imported.left_out,
                 is_model ? "positions give" : "matches would give");
  }
  return imported;
}

ImportedTracks ReadTracks(TracksForm form,
                          const ImportCommandOptions& options,
                          const TrackFile& file) {
  switch (form) {
    case TracksForm::kAuto:
    case TracksForm::kCsv:
      return ReadCsv(options, file);
    case TracksForm::kNpz:
      return ReadTracksNpz(options.tracks, file.frames, file.width_px, file.height_px, options.npz);
    case TracksForm::kOpensfm:
      return ReadOpenSfmTracks(options.tracks, file.frames, file.width_px, file.height_px);
    case TracksForm::kColmap:
      return ReadColmap(options, file);
  }
  Check(false, "every format of tracks is read");
  return {};
}

}  // namespace

void RunImport(const ImportCommandOptions& options) {
  const TracksForm form = options.from == TracksForm::kAuto ? FormOf(options.tracks) : options.from;
  if (form != TracksForm::kNpz && !ChangedOptions(options.npz).empty()) {
    ThrowUsageError("--npz.* is for NumPy files: leave it out with {}", options.tracks);
  }
  CheckOutputsGiven({options.out});
  TrackFile file = ReadClip(options.input);
  ImportedTracks imported = ReadTracks(form, options, file);
  if (imported.unknown_images == 1 &&
      CountsFromOne(imported.an_unknown_image, imported.tracks, file.frames)) {
    ThrowError(
        "{}: its images count from 1, to {}, but the frames of {} from 0: give the pictures that "
        "it "
        "was made from",
        options.tracks,
        imported.an_unknown_image,
        options.input.input);
  }
  if (imported.unknown_images > 0) {
    spdlog::warn("{}: {} of its images are not frames of {} and are left out, such as {}",
                 options.tracks,
                 imported.unknown_images,
                 options.input.input,
                 imported.an_unknown_image);
  }
  // The command line takes precedence, then a calibration over a guess.
  const bool given = !options.input.camera.empty() || !options.input.camera_prior.empty();
  if (imported.camera && !given && (!file.camera || imported.camera->known)) {
    NoteCamera(imported.camera, file);
  }
  const JobReport report = ConsoleReport();
  report.Tell(DescribeFocalGuess(file));
  if (form == TracksForm::kCsv || form == TracksForm::kNpz) {  // the others record their size
    report.Warn(DoubtOfUnits(file, options.tracks, imported.tracks, form == TracksForm::kNpz));
  }
  if (form == TracksForm::kNpz && imported.left_out > 0) {
    spdlog::warn("{}: {} visible positions lie outside the picture and count as predicted{}",
                 options.tracks,
                 imported.left_out,
                 imported.fits_exchanged
                     ? "; they lie inside if x and y are exchanged: if the tracker gives y before "
                       "x, give --npz.axes yx"
                     : "");
  }
  report.Warn(PredictOutside(file, options.tracks, options.input.input, imported.tracks));
  const auto observations = imported.tracks.observations();
  if (std::none_of(observations.begin(), observations.end(), IsObserved)) {
    spdlog::warn("{}: none of its {} positions is observed: backends use only observed positions",
                 options.tracks,
                 observations.size());
  }
  file.tracks = std::move(imported.tracks);
  file.meta.program = fmt::format("cohort {}", kVersion);
  file.meta.tracker = "import";
  file.meta.imported_from = AbsolutePath(options.tracks);
  WriteTrackFile(options.out, file);
  PrintLine("{}: {} tracks, {} observations in {} frames",
            options.out,
            file.tracks.features().size(),
            file.tracks.observations().size(),
            file.frames.size());
}

Command ImportCommand() {
  return MakeCommand({.name = "import",
                      .usage = "TRACKS --images INPUT --out F.tracks [options]",
                      .summary = "Import the tracks of any other tracker, of COLMAP or OpenSfM",
                      .positionals = {"tracks"},
                      .required = {"tracks", "input", "out"},
                      .short_flags = {{"images", {"input"}}}},
                     RunImport);
}

}  // namespace cohort
