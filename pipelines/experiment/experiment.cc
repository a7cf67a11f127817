#include "pipelines/experiment/experiment.h"

#include <spdlog/spdlog.h>

#include <charconv>
#include <chrono>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <set>

#include "datasets/degrade.h"
#include "datasets/track_truth.h"
#include "pipelines/commands/degrade.h"
#include "pipelines/commands/evaluate.h"
#include "pipelines/commands/reconstruct.h"
#include "pipelines/commands/track.h"
#include "pipelines/console/json_file.h"
#include "pipelines/experiment/tasks.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::string_view kAsIs = "as-is";

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
  if (!seed) ThrowUsageError("--seeds '{}' is no seed: give whole numbers from 0", text);
  return *seed;
}

BackendKind ParseBackend(const std::string& text) {
  for (const auto& [name, kind] : kBackendNames) {
    if (name == text) return kind;
  }
  ThrowUsageError("--backends '{}' is unknown: give ceres, colmap or both", text);
}

// A clip as it is on disk; its truth is beside it or there is none.
struct Clip {
  std::string input;
  std::string name;
  bool has_poses = false;
  bool has_track_truth = false;
};

// Everything of one clip, level and seed lies in one folder.
struct Condition {
  Clip clip;
  std::string level;
  unsigned seed = 0;
  fs::path folder;

  bool IsDegraded() const { return level != kAsIs; }
  fs::path Frames() const { return IsDegraded() ? folder / "frames" : fs::path(clip.input); }
};

struct TrackCell {
  Condition condition;
  std::string tracker;  // as named in the tables
  TrackerOptions options;
  fs::path folder;

  fs::path Tracks() const { return folder / "clip.tracks"; }
  fs::path Result() const { return folder / "tracks.json"; }
  fs::path Result(const std::string& backend) const { return folder / (backend + ".json"); }
};

std::string LabelOf(const Condition& condition) {
  return fmt::format("{} {} {}", condition.clip.name, condition.level, condition.seed);
}

// What a tracker depends on: not on the options of the others.
Json OwnOptions(const TrackerOptions& options) {
  const auto own = [&]() -> std::vector<std::string> {
    switch (options.tracker) {
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
  Json all = ToJson(options);
  Json kept{{"tracker", all["tracker"]}, {"detector", all["detector"]}};
  for (const std::string& group : own) kept[group] = all[group];
  return kept;
}

class Experiment {
 public:
  explicit Experiment(const ExperimentOptions& options)
      : options_(options), cells_folder_(fs::path(options.out) / "cells") {}

  ExperimentResults Run() {
    const Shard shard = ParseShard(options_.shard);
    for (const std::string& backend : options_.backends) ParseBackend(backend);
    for (const std::string& seed : options_.seeds) seeds_.push_back(ParseSeed(seed));
    for (const std::string& level : options_.levels) {
      if (level != kAsIs && level != "sensor") ParseLevel(level);
    }
    for (const std::string& name : options_.trackers) {
      trackers_.emplace_back(fs::path(name).stem().string(), NamedTracker(name, options_.tracking));
    }
    PrepareFolder();
    ProbeClips();
    for (const Clip& clip : clips_) {
      if (options_.protocol == Protocol::kPaper && !clip.has_track_truth) {
        ThrowError("{} has no truth of tracks: --protocol paper needs clips of `cohort synth`",
                   clip.input);
      }
    }
    MakeGrid();

    RunTasks("degrade", DegradeTasks(shard), options_.jobs, options_.resume);
    if (options_.protocol == Protocol::kPaper) {
      RunTasks("follow", FollowTasks(shard), options_.jobs, options_.resume);
      return Collect();
    }
    RunTasks("track", TrackTasks(shard), options_.jobs, options_.resume);
    RunTasks("reconstruct", ReconstructTasks(shard), options_.jobs, options_.resume);
    return Collect();
  }

 private:
  void PrepareFolder() const {
    // Other shards may be at work in the same folder.
    if (!options_.resume && options_.shard.empty()) fs::remove_all(cells_folder_);
    std::error_code error;
    fs::create_directories(cells_folder_, error);
    if (error) ThrowError("cannot make folder {}: {}", cells_folder_.string(), error.message());
  }

  // Opening a clip may start OpenCV's threads, so that this process leaves it to another.
  void ProbeClips() {
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < options_.inputs.size(); ++i) {
      const InputOptions input{options_.inputs[i], options_.layout, options_.frames, ""};
      tasks.push_back({"open " + input.input,
                       cells_folder_ / fmt::format("clip{}.json", i),
                       ToJson(input).dump(),
                       [input] {
                         const auto sequence = OpenInput(input);
                         const auto truth = OpenTrackTruth(*sequence, input.input);
                         return Json{{"name", sequence->Name()},
                                     {"has_poses", !sequence->TrueCamFromWorld().empty()},
                                     {"has_track_truth", truth != nullptr}};
                       }});
    }
    RunTasks("open", tasks, options_.jobs, options_.resume);
    std::set<std::string> names;
    for (std::size_t i = 0; i < tasks.size(); ++i) {
      const Json result = ReadJsonFile(tasks[i].result);
      if (!result["error"].is_null()) ThrowError("{}", result["error"].get<std::string>());
      const Json& figures = result["figures"];
      std::string name = figures["name"];
      for (int n = 2; !names.insert(name).second; ++n) {
        name = fmt::format("{}-{}", figures["name"].get<std::string>(), n);
      }
      clips_.push_back(
          {options_.inputs[i], name, figures["has_poses"], figures["has_track_truth"]});
    }
  }

  void MakeGrid() {
    for (const Clip& clip : clips_) {
      for (const std::string& level : options_.levels) {
        for (const unsigned seed : seeds_) {
          const Condition condition{
              clip, level, seed, cells_folder_ / clip.name / level / std::to_string(seed)};
          conditions_.push_back(condition);
          for (const auto& [name, tracker] : trackers_) {
            cells_.push_back({condition, name, tracker, condition.folder / name});
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
      DegradeCommandOptions degrade;
      degrade.input = {condition.clip.input, options_.layout, options_.frames, options_.camera};
      degrade.out = condition.Frames().string();
      degrade.degrade.seed = condition.seed;
      degrade.level = condition.level;
      if (condition.level == "sensor") {
        degrade.level = "hard";
        degrade.degrade.recipe = DegradeRecipe::kSensor;
      }
      tasks.push_back({"degrade " + LabelOf(condition),
                       condition.folder / "degrade.json",
                       ToJson(degrade).dump(),
                       [degrade] {
                         RunDegrade(degrade);
                         return Json::object();
                       }});
    }
    return tasks;
  }

  std::vector<Task> TrackTasks(const Shard& shard) const {
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (!shard.Takes(i)) continue;
      const TrackCell& cell = cells_[i];
      TrackCommandOptions track;
      track.input.input = cell.condition.Frames().string();
      if (!cell.condition.IsDegraded()) {
        track.input.layout = options_.layout;
        track.input.frames = options_.frames;
      }
      track.input.camera = options_.camera;
      track.out = cell.Tracks().string();
      track.seed = cell.condition.seed;
      track.threads = options_.jobs == 1 ? 0 : 1;
      track.json = (cell.folder / "track.json").string();
      track.tracker = cell.options;
      EvaluateCommandOptions evaluate;
      evaluate.subject = track.out;
      evaluate.truth = track.input.input;
      evaluate.layout = track.input.layout;
      evaluate.json = (cell.folder / "track_errors.json").string();
      const bool has_truth = cell.condition.clip.has_track_truth;
      tasks.push_back({fmt::format("track {} {}", LabelOf(cell.condition), cell.tracker),
                       cell.Result(),
                       ToJson(track).dump(),
                       [track, evaluate, has_truth] {
                         RunTrack(track);
                         Json figures{{"track", ReadJsonFile(track.json)}};
                         if (has_truth) {
                           RunEvaluate(evaluate);
                           figures["errors"] = ReadJsonFile(evaluate.json);
                         }
                         return figures;
                       }});
    }
    return tasks;
  }

  std::vector<Task> FollowTasks(const Shard& shard) const {
    std::vector<Task> tasks;
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      if (!shard.Takes(i)) continue;
      const TrackCell& cell = cells_[i];
      const InputOptions clip{
          cell.condition.clip.input, options_.layout, options_.frames, options_.camera};
      InputOptions frames = clip;
      if (cell.condition.IsDegraded())
        frames = {cell.condition.Frames().string(), Layout::kAuto, "", ""};
      const TrackerOptions tracker = WithoutGivingUp(cell.options);
      const Json depends_on{{"clip", ToJson(clip)},
                            {"frames", ToJson(frames)},
                            {"tracker", OwnOptions(tracker)},
                            {"paper", ToJson(options_.paper)}};
      const int threads = options_.jobs == 1 ? 0 : 1;
      tasks.push_back({fmt::format("follow {} {}", LabelOf(cell.condition), cell.tracker),
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
      for (const std::string& backend : options_.backends) {
        ReconstructCommandOptions reconstruct;
        reconstruct.tracks = cell.Tracks().string();
        reconstruct.out = (cell.folder / backend).string();
        reconstruct.backend = ParseBackend(backend);
        reconstruct.write_frames = false;
        reconstruct.ceres = options_.ceres;
        reconstruct.colmap = options_.colmap;
        reconstruct.colmap.seed = static_cast<int>(cell.condition.seed);
        EvaluateCommandOptions evaluate;
        evaluate.subject = reconstruct.out;
        evaluate.truth = cell.condition.Frames().string();
        if (!cell.condition.IsDegraded()) evaluate.layout = options_.layout;
        evaluate.json = (cell.folder / (backend + "_errors.json")).string();
        const bool has_poses = cell.condition.clip.has_poses;
        // The tracks' own options stand for what they are made of.
        const Json depends_on{{"reconstruct", ToJson(reconstruct)},
                              {"track", ReadJsonFile(cell.Result()).at("options")}};
        tasks.push_back(
            {fmt::format("{} {} {}", backend, LabelOf(cell.condition), cell.tracker),
             cell.Result(backend),
             depends_on.dump(),
             [reconstruct, evaluate, has_poses] {
               const ReconstructionSummary summary = ReconstructTracks(reconstruct);
               Json figures{{"model", ReadJsonFile(fs::path(reconstruct.out) / "summary.json")}};
               if (has_poses && !summary.Failed()) {
                 RunEvaluate(evaluate);
                 figures["errors"] = ReadJsonFile(evaluate.json);
               }
               return figures;
             }});
      }
    }
    return tasks;
  }

  ExperimentResults Collect() const {
    ExperimentResults results;
    for (const TrackCell& cell : cells_) {
      if (!fs::exists(cell.Result())) continue;  // another shard's
      AddTrackRows(cell, ReadJsonFile(cell.Result()), results);
      for (const std::string& backend : options_.backends) {
        if (!fs::exists(cell.Result(backend))) continue;
        AddModelRows(cell, backend, ReadJsonFile(cell.Result(backend)), results);
      }
    }
    return results;
  }

  class RowAdder {
   public:
    RowAdder(const TrackCell& cell, const std::string& backend, ExperimentResults& results)
        : cell_(cell), backend_(backend), results_(results) {}

    void Add(const std::string& metric, const Json& value, const std::string& unit) {
      if (value.is_null()) return;
      results_.rows.push_back({cell_.condition.clip.name,
                               cell_.condition.level,
                               cell_.tracker,
                               backend_,
                               cell_.condition.seed,
                               metric,
                               value.is_boolean() ? value.get<bool>() : value.get<double>(),
                               unit});
    }
    void Fail(const std::string& reason) {
      results_.failures.push_back({cell_.condition.clip.name,
                                   cell_.condition.level,
                                   cell_.tracker,
                                   backend_,
                                   cell_.condition.seed,
                                   reason});
    }

   private:
    const TrackCell& cell_;
    const std::string& backend_;
    ExperimentResults& results_;
  };

  static void AddTrackRows(const TrackCell& cell, const Json& result, ExperimentResults& results) {
    const std::string no_backend;
    RowAdder rows(cell, no_backend, results);
    rows.Add("failed", !result["error"].is_null(), "");
    if (!result["error"].is_null()) {
      rows.Fail(result["error"]);
      return;
    }
    if (result["figures"].contains("l1_error_px")) {
      AddFollowRows(result["figures"], rows);
      return;
    }
    const Json& track = result["figures"]["track"];
    rows.Add("tracks", track["tracks"], "");
    rows.Add("observations", track["observations"], "");
    rows.Add("predicted", track["predicted"], "");
    rows.Add("mean_track_length", track["mean_track_length"], "frames");
    rows.Add("detect_time", track["ms_per_frame"]["detect"], "ms/frame");
    rows.Add("track_time", track["ms_per_frame"]["track"], "ms/frame");
    if (!result["figures"].contains("errors")) return;
    const Json& errors = result["figures"]["errors"];
    if (!errors["observed"].is_null()) {
      rows.Add("observed_error_median", errors["observed"]["median_px"], "px");
      rows.Add("observed_error_p90", errors["observed"]["p90_px"], "px");
      rows.Add("observed_error_mean", errors["observed"]["mean_px"], "px");
    }
    rows.Add("outlier_share", errors["outlier_share"], "");
    rows.Add("predicted_precision", errors["predicted_precision"], "");
    rows.Add("predicted_recall", errors["predicted_recall"], "");
    rows.Add(kFramesBetweenMetric, errors["mean_frames_between_reinitializations"], "frames");
    rows.Add(kL1ErrorMetric, errors["l1_error_30_frames_px"], "px");
  }

  static void AddFollowRows(const Json& figures, RowAdder& rows) {
    rows.Add("features", figures["features"], "");
    rows.Add(kL1ErrorMetric, figures["l1_error_px"], "px");
    rows.Add("feature_frames", figures["feature_frames"], "frames");
    rows.Add("reinitializations", figures["reinitializations"], "");
    rows.Add("lost", figures["lost"], "");
    rows.Add(kFramesBetweenMetric, figures["frames_between_reinitializations"], "frames");
    rows.Add("track_time", figures["ms_per_frame"], "ms/frame");
  }

  static void AddModelRows(const TrackCell& cell,
                           const std::string& backend,
                           const Json& result,
                           ExperimentResults& results) {
    RowAdder rows(cell, backend, results);
    if (!result["error"].is_null()) {
      rows.Add("failed", true, "");
      rows.Fail(result["error"]);
      return;
    }
    const Json& model = result["figures"]["model"];
    rows.Add("failed", model["failed"], "");
    rows.Add("registered", model["registered"], "frames");
    rows.Add("frames", model["frames"], "frames");
    rows.Add("seconds", model["seconds"], "s");
    if (model["failed"].get<bool>()) {
      rows.Fail(fmt::format("{} of {} frames registered: {}",
                            model["registered"].get<std::size_t>(),
                            model["frames"].get<std::size_t>(),
                            model["termination"].get<std::string>()));
      return;
    }
    rows.Add("points", model["points"], "");
    rows.Add("model_track_length", model["mean_track_length"], "frames");
    rows.Add("mean_reprojection", model["mean_reprojection_px"], "px");
    if (!result["figures"].contains("errors")) return;
    const Json& errors = result["figures"]["errors"];
    rows.Add("ate", errors["ate_m"], "m");
    rows.Add("rpe_rot", errors["rpe_rot_deg"], "deg");
    rows.Add("rpe_trans", errors["rpe_trans_m"], "m");
    rows.Add("point_error_median", errors["point_error_median_m"], "m");
    rows.Add("auc_5", errors["auc_5"], "");
    rows.Add("auc_10", errors["auc_10"], "");
    rows.Add("auc_20", errors["auc_20"], "");
  }

  const ExperimentOptions& options_;
  fs::path cells_folder_;
  std::vector<unsigned> seeds_;
  std::vector<std::pair<std::string, TrackerOptions>> trackers_;  // by name in the tables
  std::vector<Clip> clips_;
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
      "N px), descent-paper, subspace-paper or F.json",
      name);
}

ExperimentResults RunExperiment(const ExperimentOptions& options) {
  return Experiment(options).Run();
}

}  // namespace cohort
