#include "pipelines/experiment/cell_jobs.h"

#include <array>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>

#include "backend/colmap/model_io.h"
#include "datasets/truth/track_truth.h"
#include "frontend/core/stopwatch.h"
#include "frontend/storage/output.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/evaluation/evaluate.h"
#include "pipelines/evaluation/halves.h"
#include "pipelines/experiment/ceiling.h"
#include "pipelines/experiment/named_trackers.h"
#include "pipelines/json/json_file.h"
#include "pipelines/sfm/reconstruct_file.h"
#include "pipelines/sfm/summary_json.h"
#include "pipelines/sfm/track_clip.h"
#include "pipelines/sfm/track_sequence.h"
#include "pipelines/sfm/video_frames.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json NotAvailable(const std::string& reason) { return {{"not_available", reason}}; }

// Cells that run in parallel share the cores.
int ThreadsOfCell(const ExperimentOptions& options) { return options.jobs == 1 ? 0 : 1; }

// Fixed parts are not looked for: they would differ with the level, and COLMAP's SIFT has none.
MaskOptions MasksOf(const ExperimentOptions& options) {
  return {.mask = options.mask, .mask_fixed = false};
}

Json ErrorsOf(const TrackCell& cell, const fs::path& subject, const fs::path& json) {
  return Evaluate({.subject = subject.string(),
                   .truth = cell.frames.input,
                   .layout = cell.frames.layout,
                   .json = json.string()});
}

TrackClipOptions TrackOf(const ExperimentOptions& options, const TrackCell& cell) {
  TrackClipOptions track;
  track.input = cell.frames;
  track.masks = MasksOf(options);
  track.out = cell.Tracks().string();
  track.threads = ThreadsOfCell(options);
  track.json = (cell.folder / "track.json").string();
  track.tracker = cell.tracker.options;
  track.second_pass = options.second_pass;
  track.second_pass.mode = cell.tracker.second_pass;
  return track;
}

Json TrackCeiling(const ExperimentOptions& options, const TrackCell& cell) {
  if (!cell.condition.IsDegraded()) {
    return NotAvailable("the noise of an undegraded clip is unknown: give --levels");
  }
  if (cell.condition.Recipe() == DegradeRecipe::kPhone) {
    return NotAvailable("the noise that a phone's denoising and encoding leave is unknown");
  }
  if (!cell.condition.clip.has_track_truth) return NotAvailable("no truth of tracks");
  const auto clip = OpenInput(ClipInput(options, cell.condition));
  const InputOptions frames = cell.frames;
  const auto dark = OpenInput(frames, MasksOf(options));
  const auto truth = OpenTrackTruth(*dark, frames.input);
  TrackFile file =
      MakeCeilingTracks(*clip, *dark, *truth, DegradationOf(cell.condition), cell.tracker.options);
  DescribeInput(frames, *dark, file);
  file.meta = {.tracker = cell.tracker.name};
  WriteTrackFile(cell.Tracks(), file);
  const Json track{{"tracks", file.tracks.features().size()},
                   {"observations", file.tracks.observations().size()},
                   {"predicted", file.tracks.CountPredicted()},
                   {"mean_track_length", file.tracks.MeanObservedLength()}};
  return {{"track", track}, {"errors", ErrorsOf(cell, cell.Tracks(), cell.TrackErrors())}};
}

Json RunPaperProtocol(const InputOptions& clip_input,
                      const InputOptions& frames_input,
                      const TrackerOptions& tracker,
                      const PaperProtocolOptions& options,
                      const MaskOptions& masks) {
  const auto clip = OpenInput(clip_input, masks);
  const auto truth = OpenTrackTruth(*clip, clip_input.input);
  const auto points = ChoosePoints(*clip, *truth, tracker.detector, options);
  const auto frames = OpenInput(frames_input);
  const auto next = [&frames] { return frames->Next(); };
  const Stopwatch stopwatch;
  const TrajectoryRun trajectories = RunTrajectories(
      *MakeMover(tracker), next, points, static_cast<std::size_t>(options.window_frames));
  const double ms = stopwatch.Milliseconds();
  if (trajectories.features == 0) {
    ThrowError("{}: no corner of the first frame stays visible for {} frames",
               clip_input.input,
               options.window_frames);
  }
  frames->Rewind();
  const ReinitializationRun life =
      RunReinitializations(*MakeMover(tracker), next, points, options.limit_px);
  return {{"features", trajectories.features},
          {"window_frames", options.window_frames},
          {"l1_error_px", trajectories.mean_l1_px},
          {"lost_of_features", trajectories.lost},
          {"ms_per_frame", ms / options.window_frames},
          {"feature_frames", life.frames},
          {"reinitializations", life.reinitializations},
          {"lost", life.lost},
          {"frames_between_reinitializations", life.MeanFramesBetween()}};
}

// Makes the model like `cohort reconstruct`.
ReconstructionSummary MakeModel(const ExperimentOptions& options,
                                const TrackCell& cell,
                                GridBackend backend,
                                const fs::path& tracks,
                                const fs::path& out) {
  ReconstructFileOptions job;
  job.tracks = tracks.string();
  job.out = out.string();
  job.reconstruct.backend =
      backend == GridBackend::kColmap ? BackendKind::kColmap : BackendKind::kCeres;
  job.reconstruct.write_frames = false;
  job.reconstruct.ceres = options.ceres;
  job.reconstruct.colmap = ColmapOptionsOf(options, cell);
  return ReconstructFile(job, ConsoleReport()).summary;
}

// The figures of a finished model.
Json WithErrors(const TrackCell& cell,
                GridBackend backend,
                const fs::path& model,
                const ReconstructionSummary& summary) {
  Json figures{{"model", ReadJsonFile(model / "summary.json")}};
  if (cell.condition.clip.has_poses && !summary.Failed()) {
    const std::string name = std::string(NameOf(kGridBackendNames, backend)) + "_errors.json";
    figures["errors"] = ErrorsOf(cell, model, cell.folder / name);
  }
  return figures;
}

Json WriteModel(const TrackCell& cell,
                GridBackend backend,
                const std::vector<FrameInfo>& frames,
                const Reconstruction& reconstruction,
                const ReconstructionSummary& summary) {
  OutputFolder out(cell.Model(backend), ModelFolderNames(), IsOurModelFolder);
  if (!reconstruction.cam_from_world.empty()) {
    WriteReconstructionFiles(out.partial(), reconstruction);
  }
  WriteJsonFile(out.partial() / "summary.json", SummaryToJson(summary, frames));
  out.Commit();
  return WithErrors(cell, backend, cell.Model(backend), summary);
}

Json TriangulateCell(const ExperimentOptions& options, const TrackCell& cell) {
  if (!cell.condition.clip.has_poses) return NotAvailable("no true cameras");
  const TrackFile file = ReadTrackFile(cell.Tracks());
  const auto frames = OpenInput(cell.frames);
  MapperResult result = TriangulateWithCeres(file, frames->TrueCamFromWorld(), options.ceres);
  return WriteModel(
      cell, GridBackend::kTriangulation, file.frames, result.reconstruction, result.summary);
}

// Otherwise its pictures would seem to be missing or incomplete.
void CheckIsDegraded(const Condition& condition) {
  if (!condition.IsDegraded()) return;
  const Json error = ReadJsonFile(condition.folder / "degrade.json").at("error");
  if (!error.is_null()) ThrowError("degrading failed: {}", error.get<std::string>());
}

Json ReconstructSift(const ExperimentOptions& options, const TrackCell& cell) {
  CheckIsDegraded(cell.condition);
  const InputOptions input = cell.frames;
  const auto frames = OpenInput(input);
  TrackFile clip = ReadFrames(*frames);
  DescribeInput(input, *frames, clip);
  const fs::path work = cell.folder / "sift";
  if (clip.image_root.empty()) {
    fs::create_directories(cell.folder);
    clip.image_root = (cell.folder / "sift_frames").string();
    WriteVideoFrames(clip, clip.image_root);
  }
  const ColmapResult result =
      ReconstructWithSift(clip, SiftOptionsOf(options), ColmapOptionsOf(options, cell), work);
  return WriteModel(cell, GridBackend::kColmap, clip.frames, result.reconstruction, result.summary);
}

// The tracks of the first pass.
TrackFile TracksToHalve(const ExperimentOptions& options, const TrackCell& cell) {
  if (!HasSecondPass(cell.tracker)) return ReadTrackFile(cell.Tracks());
  const TrackClipOptions track = TrackOf(options, cell);
  cv::setNumThreads(track.threads == 0 ? -1 : track.threads);
  const auto sequence = OpenToTrack(track.input, track.masks);
  TrackFile file = TrackFirstPass(
      *sequence,
      {.tracker = track.tracker, .second_pass = track.second_pass, .source = track.input.input});
  DescribeInput(track.input, *sequence, file);
  return file;
}

}  // namespace

Json MakeTracks(const ExperimentOptions& options, const TrackCell& cell) {
  // If this run fails, the files of an earlier run would be taken for its own.
  fs::remove(cell.Tracks());
  fs::remove(cell.TrackErrors());
  CheckIsDegraded(cell.condition);
  if (cell.tracker.source == TrackSource::kCeiling) return TrackCeiling(options, cell);
  const TrackClipOptions track = TrackOf(options, cell);
  TrackClip(track, ConsoleReport());
  Json figures{{"track", ReadJsonFile(track.json)}};
  if (cell.condition.clip.has_track_truth) {
    figures["errors"] = ErrorsOf(cell, cell.Tracks(), cell.TrackErrors());
  }
  return figures;
}

Json FollowCell(const ExperimentOptions& options, const TrackCell& cell) {
  CheckIsDegraded(cell.condition);
  const int threads = ThreadsOfCell(options);
  cv::setNumThreads(threads == 0 ? -1 : threads);
  return RunPaperProtocol(ClipInput(options, cell.condition),
                          cell.frames,
                          WithoutGivingUp(cell.tracker.options),
                          options.paper,
                          MasksOf(options));
}

Json ReconstructCell(const ExperimentOptions& options, const TrackCell& cell, GridBackend backend) {
  fs::remove_all(cell.Model(backend));  // for the same reason as in MakeTracks
  if (cell.tracker.source == TrackSource::kSift) return ReconstructSift(options, cell);
  // There may be tracks up to the frame at which tracking failed.
  const Json error = ReadJsonFile(cell.Result()).at("error");
  if (!error.is_null()) ThrowError("tracking failed: {}", error.get<std::string>());
  if (backend == GridBackend::kTriangulation) return TriangulateCell(options, cell);
  const fs::path model = cell.Model(backend);
  return WithErrors(cell, backend, model, MakeModel(options, cell, backend, cell.Tracks(), model));
}

Json CompareHalvesOfCell(const ExperimentOptions& options,
                         const TrackCell& cell,
                         GridBackend backend) {
  const fs::path folder = cell.Halves(backend);
  fs::remove_all(folder);
  fs::create_directories(folder);
  const TrackFile file = TracksToHalve(options, cell);
  const std::array<TrackSet, 2> halves = SplitTracks(file.tracks);
  std::array<std::map<FrameIndex, Rigid3>, 2> cam_from_world;
  ExperimentOptions of_half = options;
  of_half.ceres.covariances = false;  // only their cameras are compared
  Json models = Json::array();
  for (std::size_t i = 0; i < halves.size(); ++i) {
    const fs::path out = folder / std::to_string(i + 1);
    const fs::path tracks = out.string() + "_half.tracks";
    TrackFile half = file;
    half.tracks = halves[i];
    if (HasSecondPass(cell.tracker)) {
      const auto frames = OpenToTrack(cell.frames, MasksOf(options));
      half = RunSecondPass(std::move(half), *frames, options.second_pass, ConsoleReport());
    }
    WriteTrackFile(tracks, half);
    const ReconstructionSummary summary = MakeModel(of_half, cell, backend, tracks, out);
    models.push_back(ReadJsonFile(out / "summary.json"));
    if (summary.registered == 0) continue;  // no model in the folder
    cam_from_world[i] = ReadReconstruction(out).cam_from_world;
  }
  const HalvesAgreement agreement =
      CompareHalves(cam_from_world[0], cam_from_world[1], file.frames.size());
  Json figures{
      {"models", models}, {"frames_share", agreement.frames_share}, {"disagreement", nullptr}};
  if (agreement.disagreement) figures["disagreement"] = *agreement.disagreement;
  return figures;
}

SiftOptions SiftOptionsOf(const ExperimentOptions& options) {
  SiftOptions sift = options.sift;
  if (!options.mask.empty()) sift.mask = fs::absolute(options.mask).string();
  return sift;
}

ColmapOptions ColmapOptionsOf(const ExperimentOptions& options, const TrackCell& cell) {
  ColmapOptions colmap = options.colmap;
  colmap.seed = static_cast<int>(cell.condition.seed);
  return colmap;
}

}  // namespace cohort
