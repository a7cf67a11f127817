#include "pipelines/experiment/plan.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>

#include "datasets/truth/track_truth.h"
#include "pipelines/experiment/named_trackers.h"
#include "pipelines/experiment/parse_unsigned.h"
#include "pipelines/experiment/tasks.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/fingerprint.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Shard ParseShard(const std::string& text) {
  if (text.empty()) return {};
  const std::size_t slash = text.find('/');
  if (slash != std::string::npos) {
    const auto index = ParseUnsigned(std::string_view(text).substr(0, slash));
    const auto count = ParseUnsigned(std::string_view(text).substr(slash + 1));
    if (index && count && *index < *count) return {*index, *count};
  }
  ThrowUsageError("--shard '{}' is invalid: give i/n with i from 0 to n - 1", text);
}

void CheckLevel(const std::string& level) {
  if (level == kAsIs || FindRecipeLevel(level) != nullptr) return;
  try {
    ParseLevel(level);
  } catch (const UsageError& error) {
    std::string others;
    for (const RecipeLevel& recipe : kRecipeLevels) others += fmt::format("{}, ", recipe.name);
    ThrowUsageError("--levels: {}; or {}{}", error.what(), others, kAsIs);
  }
}

unsigned ParseSeed(const std::string& text) {
  const auto seed = ParseUnsigned(text);
  constexpr unsigned kMost = std::numeric_limits<int>::max();  // COLMAP's limit
  if (!seed || *seed > kMost) {
    ThrowUsageError("--seeds '{}' is not a seed: give whole numbers from 0 to {}", text, kMost);
  }
  return *seed;
}

GridBackend ParseBackend(const std::string& text) {
  for (const auto& [name, backend] : kGridBackendNames) {
    if (name == text) return backend;
  }
  ThrowUsageError("--backends '{}' is unknown: give ceres, colmap or triangulation", text);
}

// Cells with the same name would share a folder and count twice.
void CheckDistinct(const char* option, const std::vector<std::string>& names) {
  std::set<std::string> seen;
  for (const std::string& name : names) {
    if (!seen.insert(name).second) ThrowUsageError("--{} contains {} twice", option, name);
  }
}

void CheckDistinctCells(const ExperimentOptions& options, const ExperimentPlan& plan) {
  std::vector<std::string> trackers;
  for (const GridTracker& tracker : plan.trackers) trackers.push_back(tracker.name);
  std::vector<std::string> seeds;
  for (const unsigned seed : plan.seeds) seeds.push_back(std::to_string(seed));
  CheckDistinct("trackers", trackers);
  CheckDistinct("seeds", seeds);
  CheckDistinct("levels", options.levels);
  CheckDistinct("backends", options.backends);
}

void CheckTracker(const ExperimentOptions& options,
                  const ExperimentPlan& plan,
                  const GridTracker& tracker) {
  if (options.protocol == Protocol::kPaper) {
    if (tracker.source != TrackSource::kTracker) {
      ThrowUsageError("--trackers {}: not available with --protocol paper", tracker.name);
    }
    if (tracker.second_pass != options.second_pass.mode ||
        tracker.second_pass == SecondPassMode::kOn) {
      ThrowUsageError(
          "--trackers {}: --protocol paper compares trackers without a second pass: give no "
          "NAME-refined or NAME-online, and --second-pass.mode auto",
          tracker.name);
    }
  }
  if (tracker.source == TrackSource::kSift &&
      std::find(plan.backends.begin(), plan.backends.end(), GridBackend::kColmap) ==
          plan.backends.end()) {
    ThrowUsageError("--trackers sift needs backend colmap: add colmap to --backends");
  }
}

// A degraded clip has lost its metadata, but must be known as well as its source.
std::string CameraPriorOfFiles(const Sequence& sequence) {
  if (sequence.KnownCamera()) return "";
  const auto guess = sequence.FocalGuessOfFile();
  if (!guess) return "";
  return fmt::format("{}+-{}", guess->focal_px, guess->log_sigma * guess->focal_px);
}

// The input of the trackers.
InputOptions FramesOf(const ExperimentOptions& options, const Condition& condition) {
  InputOptions frames = ClipInput(options, condition);
  if (!condition.IsDegraded()) return frames;
  frames.input = condition.Frames().string();
  frames.layout = Layout::kAuto;
  frames.frames = "";
  if (frames.camera.empty() && frames.camera_prior.empty()) {
    frames.camera_prior = condition.clip.camera_prior;
  }
  return frames;
}

}  // namespace

ExperimentPlan PlanWithoutClips(const ExperimentOptions& options) {
  if (options.collect && !options.shard.empty()) {
    ThrowUsageError("--collect gathers the finished cells of all shards: leave out --shard");
  }
  ExperimentPlan plan;
  plan.cells_folder = fs::path(options.out) / "cells";
  plan.shard = ParseShard(options.shard);
  plan.halves = options.halves;
  for (const std::string& text : options.backends) plan.backends.push_back(ParseBackend(text));
  for (const std::string& seed : options.seeds) plan.seeds.push_back(ParseSeed(seed));
  for (const std::string& level : options.levels) {
    CheckLevel(level);
  }
  for (const std::string& name : options.trackers) {
    plan.trackers.push_back(NamedGridTracker(name, options.tracking, options.second_pass.mode));
    CheckTracker(options, plan, plan.trackers.back());
  }
  CheckDistinctCells(options, plan);
  return plan;
}

std::vector<GridClip> ProbeClips(const ExperimentOptions& options, const ExperimentPlan& plan) {
  // Every shard probes the clips itself.
  std::string shard_suffix = options.shard.empty() ? "" : "_shard_" + options.shard;
  std::replace(shard_suffix.begin(), shard_suffix.end(), '/', '_');
  // Checked now, because otherwise all cells would fail, hours later.
  if (const ClipMasks masks(options.mask); masks.AreGiven() && masks.AreOnePerFrame()) {
    ThrowError("--mask {}: compare takes one mask for all frames: give a picture", options.mask);
  }
  GivenCamera(ClipInput(options, {}), 0, 0);
  std::vector<Task> tasks;
  for (std::size_t i = 0; i < options.inputs.size(); ++i) {
    const InputOptions input{options.inputs[i], options.layout, options.frames, "", ""};
    tasks.push_back({"open " + input.input,
                     plan.cells_folder / fmt::format("clip{}{}.json", i, shard_suffix),
                     JsonLine(ToJson(input)),
                     [input, out = options.out] {
                       const auto sequence = OpenInput(input);
                       const auto truth = OpenTrackTruth(*sequence, input.input);
                       return Json{{"name", sequence->Name()},
                                   {"fingerprint", FingerprintOfClip(*sequence, input.input, out)},
                                   {"has_poses", !sequence->TrueCamFromWorld().empty()},
                                   {"has_track_truth", truth != nullptr},
                                   {"camera_prior", CameraPriorOfFiles(*sequence)}};
                     }});
  }
  RunTasks("open", tasks, options.jobs, false);  // always, since the files may have changed
  std::set<std::string> names;
  std::vector<GridClip> clips;
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    const Json result = ReadJsonFile(tasks[i].result);
    if (!result["error"].is_null()) ThrowError("{}", result["error"].get<std::string>());
    const Json& figures = result["figures"];
    std::string name = figures["name"];
    for (int n = 2; !names.insert(name).second; ++n) {
      name = fmt::format("{}-{}", figures["name"].get<std::string>(), n);
    }
    clips.push_back({options.inputs[i],
                     name,
                     figures["fingerprint"],
                     figures["has_poses"],
                     figures["has_track_truth"],
                     figures["camera_prior"]});
    if (options.protocol == Protocol::kPaper && !clips.back().has_track_truth) {
      ThrowError("{} has no true tracks: --protocol paper needs clips of `cohort synth`",
                 clips.back().input);
    }
  }
  return clips;
}

void AddClips(const ExperimentOptions& options,
              const std::vector<GridClip>& clips,
              ExperimentPlan& plan) {
  for (const GridClip& clip : clips) {
    for (const std::string& level : options.levels) {
      for (const unsigned seed : plan.seeds) {
        const Condition condition{
            clip, level, seed, plan.cells_folder / clip.name / level / std::to_string(seed)};
        const InputOptions frames = FramesOf(options, condition);
        plan.conditions.push_back(condition);
        for (const GridTracker& tracker : plan.trackers) {
          plan.cells.push_back({condition, tracker, frames, condition.folder / tracker.name});
        }
      }
    }
  }
}

InputOptions ClipInput(const ExperimentOptions& options, const Condition& condition) {
  return {
      condition.clip.input, options.layout, options.frames, options.camera, options.camera_prior};
}

DegradeOptions DegradationOf(const Condition& condition) {
  DegradeOptions degrade;
  degrade.seed = condition.seed;
  degrade.recipe = condition.Recipe();
  degrade.level = ParseLevel(condition.DegradeLevel());
  degrade.light = condition.Light();
  return degrade;
}

}  // namespace cohort
