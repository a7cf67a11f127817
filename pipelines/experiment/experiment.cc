#include "pipelines/experiment/experiment.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <limits>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <set>

#include "backend/colmap/model_io.h"
#include "datasets/degrade/degrade.h"
#include "datasets/truth/track_truth.h"
#include "frontend/core/output.h"
#include "pipelines/evaluation/halves.h"
#include "pipelines/experiment/ceiling.h"
#include "pipelines/experiment/cell_rows.h"
#include "pipelines/experiment/cells.h"
#include "pipelines/experiment/tasks.h"
#include "pipelines/experiment/undegraded.h"
#include "pipelines/jobs/degrade_job.h"
#include "pipelines/jobs/evaluate_job.h"
#include "pipelines/jobs/reconstruct_job.h"
#include "pipelines/jobs/track_job.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/summary_json.h"
#include "pipelines/sfm/track_sequence.h"
#include "pipelines/sfm/video_frames.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::optional<unsigned> ParseUnsigned(std::string_view text) {
  unsigned value = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

struct Shard {
  std::size_t index = 0;
  std::size_t count = 1;

  bool Takes(std::size_t i) const { return i % count == index; }
};

Shard ParseShard(const std::string& text) {
  if (text.empty()) return {};
  const std::size_t slash = text.find('/');
  if (slash != std::string::npos) {
    const auto index = ParseUnsigned(std::string_view(text).substr(0, slash));
    const auto count = ParseUnsigned(std::string_view(text).substr(slash + 1));
    if (index && count && *index < *count) return {*index, *count};
  }
  ThrowUsageError("--shard '{}' is none: give i/n with i from 0 to n - 1", text);
}

unsigned ParseSeed(const std::string& text) {
  const auto seed = ParseUnsigned(text);
  constexpr unsigned kMost = std::numeric_limits<int>::max();  // COLMAP's
  if (!seed || *seed > kMost) {
    ThrowUsageError("--seeds '{}' is no seed: give whole numbers from 0 to {}", text, kMost);
  }
  return *seed;
}

GridBackend ParseBackend(const std::string& text) {
  for (const auto& [name, backend] : kGridBackendNames) {
    if (name == text) return backend;
  }
  ThrowUsageError("--backends '{}' is unknown: give ceres, colmap or triangulation", text);
}

// Cells of the same name would share a folder and count twice.
void CheckDistinct(const char* option, const std::vector<std::string>& names) {
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (!seen.insert(name).second) ThrowUsageError("--{} has {} twice", option, name);
  }
}

std::string LabelOf(const Condition& condition) {
  return fmt::format("{} {} {}", condition.clip.name, condition.level, condition.seed);
}

std::string LabelOf(const TrackCell& cell, GridBackend backend) {
  return fmt::format(
      "{} {} {}", NameOf(kGridBackendNames, backend), LabelOf(cell.condition), cell.tracker.name);
}

// The options that a tracker's tracks depend on: without those of the other trackers.
Json OwnOptions(const GridTracker& tracker) {
  const auto own = [&]() -> std::set<std::string> {
    if (tracker.source != TrackSource::kTracker) return {};
    switch (tracker.options.tracker) {
      case TrackerKind::kSubspace:
      case TrackerKind::kDescent:
        return {"subspace", "measurement"};
      case TrackerKind::kKlt:
        return {"klt"};
      case TrackerKind::kAnchoredKlt:
        return {"anchored_klt"};
      case TrackerKind::kRlof:
        return {"rlof"};
      case TrackerKind::kDis:
      case TrackerKind::kDeepFlow:
        return {"dense_flow"};
    }
    return {};
  }();
  Json kept = Json::object();
  const Json all = ToJson(tracker.options);
  for (const auto& [name, value] : all.items()) {
    const bool is_group = value.is_object() && name != "detector";
    if (!is_group || own.contains(name)) kept[name] = value;
  }
  if (tracker.source != TrackSource::kTracker) kept["tracker"] = tracker.name;
  return kept;
}

GridTracker TrackerOf(const std::string& name,
                      const TrackerOptions& base,
                      SecondPassMode second_pass) {
  if (name == "ceiling") return {name, TrackSource::kCeiling, base};
  if (name == "sift") return {name, TrackSource::kSift, base};
  GridTracker tracker{fs::path(name).stem().string(), TrackSource::kTracker, base, second_pass};
  std::string first_pass = name;
  for (const auto& [suffix, mode] :
       {std::pair("-refined", SecondPassMode::kOn), std::pair("-online", SecondPassMode::kOff)}) {
    if (!name.ends_with(suffix)) continue;
    first_pass = name.substr(0, name.size() - std::string_view(suffix).size());
    tracker.second_pass = mode;
  }
  tracker.options = NamedTracker(first_pass, base);
  return tracker;
}

bool HasSecondPass(const GridTracker& tracker) {
  return tracker.source == TrackSource::kTracker &&
         WantsSecondPass(tracker.second_pass, tracker.options);
}

// Changes when a file of the clip does: names, sizes and times of writing.
std::string FingerprintOf(const std::string& input) {
  std::set<std::string> files;
  const auto add = [&files](const fs::path& path) {
    std::error_code error;
    const auto size = fs::file_size(path, error);
    if (error) return;
    const auto written = fs::last_write_time(path, error).time_since_epoch().count();
    files.insert(fmt::format("{} {} {}", path.filename().string(), size, written));
  };
  if (fs::is_regular_file(input)) {
    add(input);
  } else {
    fs::path folder = fs::absolute(input);  // of a glob that which holds it
    while (!fs::is_directory(folder)) folder = folder.parent_path();
    for (const auto& entry : fs::recursive_directory_iterator(folder)) add(entry.path());
  }
  std::uint64_t hash = 14695981039346656037ULL;  // FNV-1a
  for (const std::string& file : files) {
    for (const char c : file + "\n") {
      hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
    }
  }
  return fmt::format("{:016x}", hash);
}

Json NotAvailable(const std::string& reason) { return {{"not_available", reason}}; }

class Experiment {
 public:
  explicit Experiment(const ExperimentOptions& options)
      : options_(options), cells_folder_(fs::path(options.out) / "cells") {}

  ExperimentResults Run() {
    const Shard shard = ParseShard(options_.shard);
    for (const std::string& text : options_.backends) backends_.push_back(ParseBackend(text));
    for (const std::string& seed : options_.seeds) seeds_.push_back(ParseSeed(seed));
    for (const std::string& level : options_.levels) {
      if (level != kAsIs && level != kSensor) ParseLevel(level);
    }
    for (const std::string& name : options_.trackers) {
      trackers_.push_back(TrackerOf(name, options_.tracking, options_.second_pass.mode));
      CheckTracker(trackers_.back());
    }
    CheckGrid();
    MakeFolder();
    ProbeClips();
    for (const GridClip& clip : clips_) {
      if (options_.protocol == Protocol::kPaper && !clip.has_track_truth) {
        ThrowError("{} has no truth of tracks: --protocol paper needs clips of `cohort synth`",
                   clip.input);
      }
    }
    // Not before the inputs are known to be good. Other shards may be at work in the same folder.
    if (!options_.resume && options_.shard.empty()) {
      fs::remove_all(cells_folder_);
      MakeFolder();
    }
    MakeGrid();

    RunTasks("degrade", DegradeTasks(shard), options_.jobs, options_.resume);
    if (options_.protocol == Protocol::kPaper) {
      RunTasks("follow", FollowTasks(shard), options_.jobs, options_.resume);
      return Collect();
    }
    RunTasks("track", TrackTasks(shard), options_.jobs, options_.resume);
    RunTasks("reconstruct", ReconstructTasks(shard), options_.jobs, options_.resume);
    RunTasks("halves", HalvesTasks(shard), options_.jobs, options_.resume);
    return Collect();
  }

 private:
  void CheckTracker(const GridTracker& tracker) const {
    if (tracker.source != TrackSource::kTracker && options_.protocol == Protocol::kPaper) {
      ThrowUsageError("--trackers {}: not with --protocol paper", tracker.name);
    }
    if (tracker.source == TrackSource::kSift &&
        std::find(backends_.begin(), backends_.end(), GridBackend::kColmap) == backends_.end()) {
      ThrowUsageError("--trackers sift is COLMAP alone: add colmap to --backends");
    }
  }

  void CheckGrid() const {
    std::vector<std::string> trackers;
    for (const GridTracker& tracker : trackers_) trackers.push_back(tracker.name);
    std::vector<std::string> seeds;
    for (const unsigned seed : seeds_) seeds.push_back(std::to_string(seed));
    CheckDistinct("trackers", trackers);
    CheckDistinct("seeds", seeds);
    CheckDistinct("levels", options_.levels);
    CheckDistinct("backends", options_.backends);
  }

  void MakeFolder() const {
    std::error_code error;
    fs::create_directories(cells_folder_, error);
    if (error) ThrowError("cannot make folder {}: {}", cells_folder_.string(), error.message());
  }

  // Opening a clip may start OpenCV's threads, so that this process leaves it to another.
  void ProbeClips() {
    // Every shard asks for itself.
    std::string shard_suffix = options_.shard.empty() ? "" : "_shard_" + options_.shard;
    std::replace(shard_suffix.begin(), shard_suffix.end(), '/', '_');
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < options_.inputs.size(); ++i) {
      const InputOptions input{options_.inputs[i], options_.layout, options_.frames, ""};
      tasks.push_back({"open " + input.input,
                       cells_folder_ / fmt::format("clip{}{}.json", i, shard_suffix),
                       ToJson(input).dump(),
                       [input] {
                         const auto sequence = OpenInput(input);
                         const auto truth = OpenTrackTruth(*sequence, input.input);
                         return Json{{"name", sequence->Name()},
                                     {"fingerprint", FingerprintOf(input.input)},
                                     {"has_poses", !sequence->TrueCamFromWorld().empty()},
                                     {"has_track_truth", truth != nullptr}};
                       }});
    }
    RunTasks("open", tasks, options_.jobs, false);  // always: the files may have changed
    std::set<std::string> names;
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      const Json result = ReadJsonFile(tasks[i].result);
      if (!result["error"].is_null()) ThrowError("{}", result["error"].get<std::string>());
      const Json& figures = result["figures"];
      std::string name = figures["name"];
      for (int n = 2; !names.insert(name).second; ++n) {
        name = fmt::format("{}-{}", figures["name"].get<std::string>(), n);
      }
      clips_.push_back({options_.inputs[i],
                        name,
                        figures["fingerprint"],
                        figures["has_poses"],
                        figures["has_track_truth"]});
    }
  }

  void MakeGrid() {
    for (const GridClip& clip : clips_) {
      for (const std::string& level : options_.levels) {
        for (const unsigned seed : seeds_) {
          const Condition condition{
              clip, level, seed, cells_folder_ / clip.name / level / std::to_string(seed)};
          conditions_.push_back(condition);
          for (const GridTracker& tracker : trackers_) {
            cells_.push_back(
                {condition, tracker, FramesInput(condition), condition.folder / tracker.name});
          }
        }
      }
    }
  }

  // The degradation of every condition that has a cell in the shard.
  std::vector<Task> DegradeTasks(const Shard& shard) const {
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < conditions_.size(); ++i) {
      bool needed = false;
      for (std::size_t t = 0; t < trackers_.size(); ++t) {
        needed = needed || shard.Takes(i * trackers_.size() + t);
      }
      const Condition& condition = conditions_[i];
      if (!needed || !condition.IsDegraded()) continue;
      DegradeJobOptions degrade;
      degrade.input = ClipInput(condition);
      degrade.out = condition.Frames().string();
      degrade.degrade = DegradeOf(condition);
      degrade.level = condition.DegradeLevel();
      const Json depends_on{{"degrade", ToJson(degrade)},
                            {"fingerprint", condition.clip.fingerprint}};
      tasks.push_back({"degrade " + LabelOf(condition),
                       condition.folder / "degrade.json",
                       depends_on.dump(),
                       [degrade] {
                         RunDegradeJob(degrade);
                         return Json::object();
                       },
                       !options_.shard.empty()});
    }
    return tasks;
  }

  InputOptions ClipInput(const Condition& condition) const {
    return {condition.clip.input, options_.layout, options_.frames, options_.camera};
  }
  // What the trackers read.
  InputOptions FramesInput(const Condition& condition) const {
    if (!condition.IsDegraded()) return ClipInput(condition);
    return {condition.Frames().string(), Layout::kAuto, "", options_.camera};
  }

  static DegradeOptions DegradeOf(const Condition& condition) {
    DegradeOptions degrade;
    degrade.seed = condition.seed;
    if (condition.level == kSensor) degrade.recipe = DegradeRecipe::kSensor;
    degrade.level = ParseLevel(condition.DegradeLevel());
    return degrade;
  }

  // The frames, and what is done to them.
  Json DependenciesOf(const TrackCell& cell) const {
    Json depends_on{{"clip", ToJson(ClipInput(cell.condition))},
                    {"fingerprint", cell.condition.clip.fingerprint},
                    {"level", cell.condition.level},
                    {"seed", cell.condition.seed},
                    {"tracker", OwnOptions(cell.tracker)}};
    if (options_.protocol == Protocol::kReconstruction && HasSecondPass(cell.tracker)) {
      depends_on["second_pass"] = ToJson(options_.second_pass);
    }
    return depends_on;
  }

  TrackJobOptions TrackOf(const TrackCell& cell) const {
    TrackJobOptions track;
    track.input = cell.frames;
    track.out = cell.Tracks().string();
    track.seed = cell.condition.seed;
    track.threads = options_.jobs == 1 ? 0 : 1;
    track.json = (cell.folder / "track.json").string();
    track.tracker = cell.tracker.options;
    track.second_pass = options_.second_pass;
    track.second_pass.mode = cell.tracker.second_pass;
    return track;
  }

  std::vector<Task> TrackTasks(const Shard& shard) const {
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      const TrackCell& cell = cells_[i];
      if (!shard.Takes(i) || cell.tracker.source == TrackSource::kSift) continue;
      tasks.push_back({fmt::format("track {} {}", LabelOf(cell.condition), cell.tracker.name),
                       cell.Result(),
                       DependenciesOf(cell).dump(),
                       [this, &cell] {
                         // What an earlier run left would stand for this one, should it fail.
                         fs::remove(cell.Tracks());
                         fs::remove(cell.TrackErrors());
                         if (cell.tracker.source == TrackSource::kCeiling) {
                           return TrackCeiling(cell);
                         }
                         const TrackJobOptions track = TrackOf(cell);
                         RunTrackJob(track);
                         Json figures{{"track", ReadJsonFile(track.json)}};
                         if (cell.condition.clip.has_track_truth) {
                           figures["errors"] = Evaluate(cell, cell.Tracks(), cell.TrackErrors());
                         }
                         return figures;
                       }});
    }
    return tasks;
  }

  Json TrackCeiling(const TrackCell& cell) const {
    if (!cell.condition.IsDegraded()) {
      return NotAvailable("the noise of a clip as it is is not known: give --levels");
    }
    if (!cell.condition.clip.has_track_truth) return NotAvailable("no truth of tracks");
    const auto clip = OpenInput(ClipInput(cell.condition));
    const InputOptions frames = cell.frames;
    const auto dark = OpenInput(frames);
    const auto truth = OpenTrackTruth(*dark, frames.input);
    TrackFile file =
        MakeCeilingTracks(*clip, *dark, *truth, DegradeOf(cell.condition), cell.tracker.options);
    DescribeInput(frames, *dark, file);
    file.meta = {{"tracker", cell.tracker.name}};
    WriteTrackFile(cell.Tracks(), file);
    const Json track{{"tracks", file.tracks.features().size()},
                     {"observations", file.tracks.observations().size()},
                     {"predicted", file.tracks.CountPredicted()},
                     {"mean_track_length", file.tracks.MeanObservedLength()}};
    return {{"track", track}, {"errors", Evaluate(cell, cell.Tracks(), cell.TrackErrors())}};
  }

  Json Evaluate(const TrackCell& cell, const fs::path& subject, const fs::path& json) const {
    const InputOptions frames = cell.frames;
    return RunEvaluateJob({.subject = subject.string(),
                           .truth = frames.input,
                           .layout = frames.layout,
                           .json = json.string()});
  }

  std::vector<Task> FollowTasks(const Shard& shard) const {
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (!shard.Takes(i)) continue;
      const TrackCell& cell = cells_[i];
      const InputOptions clip = ClipInput(cell.condition);
      const InputOptions frames = cell.frames;
      const TrackerOptions tracker = WithoutGivingUp(cell.tracker.options);
      Json depends_on = DependenciesOf(cell);
      depends_on["paper"] = ToJson(options_.paper);
      const int threads = options_.jobs == 1 ? 0 : 1;
      tasks.push_back({fmt::format("follow {} {}", LabelOf(cell.condition), cell.tracker.name),
                       cell.Result(),
                       depends_on.dump(),
                       [this, clip, frames, tracker, threads] {
                         cv::setNumThreads(threads == 0 ? -1 : threads);
                         return RunPaperProtocol(clip, frames, tracker, options_.paper);
                       }});
    }
    return tasks;
  }

  static Json RunPaperProtocol(const InputOptions& clip_input,
                               const InputOptions& frames_input,
                               const TrackerOptions& tracker,
                               const PaperProtocolOptions& options) {
    const auto clip = OpenInput(clip_input);
    const auto truth = OpenTrackTruth(*clip, clip_input.input);
    const auto points = ChoosePoints(*clip, *truth, tracker.detector, options);
    const auto frames = OpenInput(frames_input);
    const auto next = [&frames] { return frames->Next(); };
    const auto start = std::chrono::steady_clock::now();
    const TrajectoryRun trajectories = RunTrajectories(
        *MakeMover(tracker), next, points, static_cast<std::size_t>(options.window_frames));
    const std::chrono::duration<double, std::milli> ms = std::chrono::steady_clock::now() - start;
    if (trajectories.features == 0) {
      ThrowError("{}: no corner of its first frame stays visible for {} frames",
                 clip_input.input,
                 options.window_frames);
    }
    frames->Rewind();
    const ReinitializationRun life =
        RunReinitializations(*MakeMover(tracker), next, points, options.limit_px);
    return {{"features", trajectories.features},
            {"l1_error_px", trajectories.mean_l1_px},
            {"lost_of_features", trajectories.lost},
            {"ms_per_frame", ms.count() / options.window_frames},
            {"feature_frames", life.frames},
            {"reinitializations", life.reinitializations},
            {"lost", life.lost},
            {"frames_between_reinitializations", life.MeanFramesBetween()}};
  }

  std::vector<Task> ReconstructTasks(const Shard& shard) const {
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (!shard.Takes(i)) continue;
      const TrackCell& cell = cells_[i];
      const bool has_tracks = cell.tracker.source != TrackSource::kSift;
      if (has_tracks && ReadJsonFile(cell.Result()).at("figures").contains("not_available"))
        continue;
      for (const GridBackend backend : backends_) {
        if (!cell.Has(backend)) continue;
        tasks.push_back({LabelOf(cell, backend),
                         cell.Result(backend),
                         ModelDependenciesOf(cell, backend),
                         [this, &cell, backend] { return ReconstructCell(cell, backend); }});
      }
    }
    return tasks;
  }

  std::string ModelDependenciesOf(const TrackCell& cell, GridBackend backend) const {
    Json depends_on = DependenciesOf(cell);
    depends_on["backend"] = OptionsOf(cell, backend);
    return depends_on.dump();
  }

  // Of the models that have been made. Tasks of their own: what goes wrong with a half leaves the
  // model as it is.
  std::vector<Task> HalvesTasks(const Shard& shard) const {
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (!shard.Takes(i)) continue;
      const TrackCell& cell = cells_[i];
      for (const GridBackend backend : backends_) {
        if (!cell.HasHalves(backend) || !HasModel(ReadJsonFile(cell.Result(backend)))) continue;
        tasks.push_back({"halves " + LabelOf(cell, backend),
                         cell.HalvesResult(backend),
                         ModelDependenciesOf(cell, backend),
                         [this, &cell, backend] { return ByHalves(cell, backend); }});
      }
    }
    return tasks;
  }

  ColmapOptions ColmapOf(const TrackCell& cell) const {
    ColmapOptions colmap = options_.colmap;
    colmap.seed = static_cast<int>(cell.condition.seed);
    return colmap;
  }

  Json OptionsOf(const TrackCell& cell, GridBackend backend) const {
    switch (backend) {
      case GridBackend::kCeres:
      case GridBackend::kTriangulation:
        return {{"ceres", ToJson(options_.ceres)}};
      case GridBackend::kColmap:
        Json options{{"colmap", ToJson(ColmapOf(cell))}};
        if (cell.tracker.source == TrackSource::kSift) options["sift"] = ToJson(options_.sift);
        return options;
    }
    ThrowUsageError("unknown backend");
  }

  Json ReconstructCell(const TrackCell& cell, GridBackend backend) const {
    fs::remove_all(cell.Model(backend));  // as of tracks
    if (cell.tracker.source != TrackSource::kSift) {
      // Tracks may be there, of the frames until it failed.
      const Json error = ReadJsonFile(cell.Result()).at("error");
      if (!error.is_null()) ThrowError("tracking failed: {}", error.get<std::string>());
    }
    if (cell.tracker.source == TrackSource::kSift) return BySift(cell);
    if (backend == GridBackend::kTriangulation) return ByTriangulation(cell);
    const fs::path model = cell.Model(backend);
    return WithErrors(cell, backend, model, MakeModel(cell, backend, cell.Tracks(), model));
  }

  // By the command of ceres or colmap.
  ReconstructionSummary MakeModel(const TrackCell& cell,
                                  GridBackend backend,
                                  const fs::path& tracks,
                                  const fs::path& out) const {
    ReconstructJobOptions job;
    job.tracks = tracks.string();
    job.out = out.string();
    job.reconstruct.backend =
        backend == GridBackend::kColmap ? BackendKind::kColmap : BackendKind::kCeres;
    job.reconstruct.write_frames = false;
    job.reconstruct.ceres = options_.ceres;
    job.reconstruct.colmap = ColmapOf(cell);
    return RunReconstructJob(job);
  }

  // A finished model's figures.
  Json WithErrors(const TrackCell& cell,
                  GridBackend backend,
                  const fs::path& model,
                  const ReconstructionSummary& summary) const {
    Json figures{{"model", ReadJsonFile(model / "summary.json")}};
    if (cell.condition.clip.has_poses && !summary.Failed()) {
      const std::string name = std::string(NameOf(kGridBackendNames, backend)) + "_errors.json";
      figures["errors"] = Evaluate(cell, model, cell.folder / name);
    }
    return figures;
  }

  // Halves that had a second pass together would agree by it: each gets one of its own.
  TrackFile TracksToHalve(const TrackCell& cell) const {
    if (!HasSecondPass(cell.tracker)) return ReadTrackFile(cell.Tracks());
    TrackJobOptions track = TrackOf(cell);
    track.out = cell.folder / "first_pass.tracks";
    track.json.clear();
    track.second_pass.mode = SecondPassMode::kOff;
    RunTrackJob(track);
    return ReadTrackFile(track.out);
  }

  Json ByHalves(const TrackCell& cell, GridBackend backend) const {
    const fs::path folder = cell.Halves(backend);
    fs::remove_all(folder);
    fs::create_directories(folder);
    const TrackFile file = TracksToHalve(cell);
    const std::array<TrackSet, 2> halves = SplitTracks(file.tracks);
    std::array<std::map<FrameIndex, Rigid3>, 2> cam_from_world;
    Json models = Json::array();
    for (std::size_t i = 0; i < halves.size(); ++i) {
      const fs::path out = folder / std::to_string(i + 1);
      const fs::path tracks = out.string() + "_half.tracks";
      TrackFile half = file;
      half.tracks = halves[i];
      if (HasSecondPass(cell.tracker)) {
        const auto frames = OpenInput(cell.frames);
        half = WithSecondPass(std::move(half), *frames, {}, options_.second_pass).file;
      }
      WriteTrackFile(tracks, half);
      const ReconstructionSummary summary = MakeModel(cell, backend, tracks, out);
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

  Json ByTriangulation(const TrackCell& cell) const {
    if (!cell.condition.clip.has_poses) return NotAvailable("no true cameras");
    const TrackFile file = ReadTrackFile(cell.Tracks());
    const auto frames = OpenInput(cell.frames);
    MapperResult result = TriangulateWithCeres(file, frames->TrueCamFromWorld(), options_.ceres);
    return WriteModel(
        cell, GridBackend::kTriangulation, file.frames, result.reconstruction, result.summary);
  }

  Json BySift(const TrackCell& cell) const {
    const InputOptions input = cell.frames;
    const auto frames = OpenInput(input);
    TrackFile clip;  // without tracks
    while (const auto frame = frames->Next()) {
      clip.frames.push_back({frame->index, frame->name, frame->timestamp_ns});
      clip.width_px = frame->gray.cols;
      clip.height_px = frame->gray.rows;
    }
    DescribeInput(input, *frames, clip);
    const fs::path work = cell.folder / "sift";
    if (clip.image_root.empty()) {
      fs::create_directories(cell.folder);
      clip.image_root = (cell.folder / "sift_frames").string();
      WriteVideoFrames(clip, clip.image_root);
    }
    const ColmapResult result = ReconstructWithSift(clip, options_.sift, ColmapOf(cell), work);
    return WriteModel(
        cell, GridBackend::kColmap, clip.frames, result.reconstruction, result.summary);
  }

  Json WriteModel(const TrackCell& cell,
                  GridBackend backend,
                  const std::vector<FrameInfo>& frames,
                  const Reconstruction& reconstruction,
                  const ReconstructionSummary& summary) const {
    OutputFolder out(cell.Model(backend), ModelFolderNames());
    if (!reconstruction.cam_from_world.empty()) {
      WriteReconstructionFiles(out.partial(), reconstruction);
    }
    WriteJsonFile(out.partial() / "summary.json", SummaryToJson(summary, frames));
    out.Commit();
    return WithErrors(cell, backend, cell.Model(backend), summary);
  }

  ExperimentResults Collect() const {
    ExperimentResults results;
    results.cells = cells_;
    for (const TrackCell& cell : cells_) {
      if (fs::exists(cell.Result())) AddTrackRows(cell, ReadJsonFile(cell.Result()), results);
      for (const GridBackend backend : backends_) {  // what is not there is another shard's
        if (!fs::exists(cell.Result(backend))) continue;
        const Json result = ReadJsonFile(cell.Result(backend));
        AddModelRows(cell, backend, result, results);
        if (cell.HasHalves(backend)) {
          const fs::path halves = cell.HalvesResult(backend);
          AddHalvesRows(
              cell, backend, result, fs::exists(halves) ? ReadJsonFile(halves) : Json(), results);
        }
        AddUndegradedRow(cell, backend, results);
      }
    }
    return results;
  }

  // Real clips: also against the reconstruction of the undegraded frames, where the grid has them.
  // One for all trackers, and the opponent's: that of the last plain KLT.
  void AddUndegradedRow(const TrackCell& cell,
                        GridBackend backend,
                        ExperimentResults& results) const {
    const GridClip& clip = cell.condition.clip;
    if (!clip.has_poses || clip.has_track_truth || !cell.condition.IsDegraded() ||
        backend == GridBackend::kTriangulation) {
      return;
    }
    const TrackCell* reference = nullptr;
    for (const TrackCell& other : cells_) {
      if (!other.condition.IsDegraded() && other.condition.clip.name == clip.name &&
          other.condition.seed == seeds_.front() && other.tracker.source == TrackSource::kTracker &&
          other.tracker.options.tracker == TrackerKind::kKlt) {
        reference = &other;
      }
    }
    if (reference == nullptr) return;
    const auto frames = OpenInput(reference->frames);
    const auto error = ErrorToUndegraded(
        cell.Model(backend), reference->Model(backend), frames->TrueCamFromWorld());
    if (!error) return;
    results.rows.push_back({clip.name,
                            cell.condition.level,
                            cell.tracker.name,
                            std::string(NameOf(kGridBackendNames, backend)),
                            cell.condition.seed,
                            "ate_to_undegraded",
                            *error,
                            "m"});
  }

  const ExperimentOptions& options_;
  fs::path cells_folder_;
  std::vector<unsigned> seeds_;
  std::vector<GridTracker> trackers_;
  std::vector<GridBackend> backends_;
  std::vector<GridClip> clips_;
  std::vector<Condition> conditions_;
  std::vector<TrackCell> cells_;
};

}  // namespace

TrackerOptions NamedTracker(const std::string& name, const TrackerOptions& base) {
  TrackerOptions options = base;
  if (name.ends_with(".json")) {
    SetFromJson(ListOptions(options), ReadJsonFile(name), name);
    return options;
  }
  for (const auto& [text, kind] : kTrackerNames) {
    if (name == text) {
      options.tracker = kind;
      return options;
    }
  }
  if (name == "subspace-paper" || name == "descent-paper") {
    options.tracker = name == "subspace-paper" ? TrackerKind::kSubspace : TrackerKind::kDescent;
    options.subspace = PaperSubspaceOptions();
    options.measurement.enabled = false;
    return options;
  }
  if (name == "subspace-fused") {
    options.tracker = TrackerKind::kSubspace;
    options.measurement.fuse = true;
    return options;
  }
  const auto window_behind = [&name](std::string_view prefix) -> std::optional<unsigned> {
    if (!name.starts_with(prefix)) return std::nullopt;
    return ParseUnsigned(std::string_view(name).substr(prefix.size()));
  };
  if (const auto window = window_behind("klt")) {
    options.tracker = TrackerKind::kKlt;
    options.klt.window_px = static_cast<int>(*window);
    ValidateOptions(options);
    return options;
  }
  if (const auto window = window_behind("anchored-klt")) {
    options.tracker = TrackerKind::kAnchoredKlt;
    options.anchored_klt.window_px = static_cast<int>(*window);
    ValidateOptions(options);
    return options;
  }
  ThrowUsageError(
      "tracker '{}' is unknown: give a tracker of `cohort track`, kltN or anchored-kltN (window "
      "N px), descent-paper, subspace-paper, subspace-fused, ceiling, sift or F.json",
      name);
}

ExperimentResults RunExperiment(const ExperimentOptions& options) {
  return Experiment(options).Run();
}

}  // namespace cohort
