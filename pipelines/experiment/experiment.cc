#include "pipelines/experiment/experiment.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>

#include "backend/colmap/program.h"
#include "frontend/core/error.h"
#include "frontend/storage/input_record.h"
#include "frontend/storage/output.h"
#include "frontend/storage/write_lock.h"
#include "pipelines/experiment/cell_rows.h"
#include "pipelines/experiment/cell_tasks.h"
#include "pipelines/experiment/collection.h"
#include "pipelines/experiment/plan.h"
#include "pipelines/experiment/tasks.h"
#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// Marks the folder of the cells, which a new run removes and creates again.
constexpr const char* kMark = "cells_of_cohort_compare";

void MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) ThrowError("cannot make folder {}: {}", folder.string(), error.message());
}

// Whether the cell has all of its results, good or bad.
bool IsFinished(const ExperimentOptions& options,
                const ExperimentPlan& plan,
                const TrackCell& cell) {
  const bool has_tracks = cell.tracker.source != TrackSource::kSift;
  if (has_tracks) {
    if (!HasOwnResult(options, cell)) return false;
    if (options.protocol == Protocol::kPaper) return true;
    if (IsNotAvailable(cell.Result())) return true;
  }
  for (const GridBackend backend : plan.backends) {
    if (!cell.Has(backend)) continue;
    if (!HasResult(ModelTask(options, cell, backend))) return false;
    if (!plan.halves || !cell.HasHalves(backend)) continue;
    const bool has_model = HasModel(cell.Result(backend));
    if (has_model && !HasResult(HalvesTask(options, cell, backend))) return false;
  }
  return true;
}

// Throws Error if there is nothing to collect; warns of missing cells.
void CheckWhatIsFinished(const ExperimentOptions& options, const ExperimentPlan& plan) {
  const auto finished =
      std::count_if(plan.cells.begin(), plan.cells.end(), [&](const TrackCell& cell) {
        return IsFinished(options, plan, cell);
      });
  if (finished == 0) {
    ThrowError("no cell of this grid is finished in {}: first run it, or shards of it",
               options.out);
  }
  if (finished < std::ssize(plan.cells)) {
    spdlog::warn("{} of {} cells are not finished: the results do not include them",
                 std::ssize(plan.cells) - finished,
                 plan.cells.size());
  }
}

// A folder that will be removed must come from an earlier run and contain no input.
void CheckCellsAreOurs(const ExperimentOptions& options, const fs::path& cells) {
  for (const std::string& input : options.inputs) InputRecord::Add(input);
  CheckFolderHoldsNoInput(cells);
  if (!fs::is_directory(cells) || fs::is_empty(cells)) return;
  for (const auto& entry : fs::directory_iterator(cells)) {
    const std::string name = entry.path().filename().string();
    if (name == kMark || name == "results.lock" ||
        (name.starts_with("clip0") && name.ends_with(".json"))) {
      return;
    }
  }
  ThrowError(
      "{} is where the cells belong, but was not written by a comparison: give another --out",
      cells.string());
}

// Prevents two runs of the same shard, which a queue may have started twice.
WriteLock LockOfShard(const ExperimentPlan& plan) {
  return WriteLock::OfLockFile(
      plan.cells_folder / fmt::format("shard_{}_of_{}.lock", plan.shard.index, plan.shard.count));
}

// Without COLMAP all its cells would fail, as if the trackers had failed.
void CheckColmapIsThere(const ExperimentOptions& options, const ExperimentPlan& plan) {
  if (options.protocol == Protocol::kPaper ||
      std::ranges::find(plan.backends, GridBackend::kColmap) == plan.backends.end()) {
    return;
  }
  try {
    RequireColmap(options.colmap.program, options.colmap.max_minutes);
  } catch (const Error& error) {
    ThrowError("{}, or leave colmap out of --backends", error.what());
  }
}

}  // namespace

ExperimentPlan RunCells(const ExperimentOptions& options) {
  ExperimentPlan plan = PlanWithoutClips(options);
  if (!options.resume && !options.collect) CheckColmapIsThere(options, plan);
  const bool anew = !options.resume && !options.collect && options.shard.empty();
  if (anew) CheckCellsAreOurs(options, plan.cells_folder);
  MakeFolder(plan.cells_folder);
  if (!fs::exists(plan.cells_folder / kMark)) WriteBytes(plan.cells_folder / kMark, "");
  // Shards may share a folder, and collecting is possible at any time; two complete grids may not
  // share one.
  plan.locks.push_back(WriteLock::Of(options.out, options.collect || !options.shard.empty()));
  if (!options.shard.empty() && !options.collect) plan.locks.push_back(LockOfShard(plan));
  const std::vector<GridClip> clips = ProbeClips(options, plan);
  // Not before the inputs have been checked, and not with shards, since others may be running in
  // the same folder.
  if (anew) {
    CheckFolderHoldsNoInput(plan.cells_folder);  // again, since the mask has been read
    for (const auto& entry : fs::directory_iterator(plan.cells_folder)) {
      if (entry.path().filename() != kMark) fs::remove_all(entry.path());
    }
  }
  AddClips(options, clips, plan);
  if (options.collect) {
    CheckWhatIsFinished(options, plan);
    return plan;
  }

  const auto run = [&options](const char* stage, const std::vector<Task>& tasks) {
    RunTasks(stage, tasks, options.jobs, options.resume);
  };
  run("degrade", DegradeTasks(options, plan));
  if (options.protocol == Protocol::kPaper) {
    run("follow", FollowTasks(options, plan));
    return plan;
  }
  run("track", TrackTasks(options, plan));
  const std::vector<Task> reconstruct = ReconstructTasks(options, plan);
  if (options.resume && !std::ranges::all_of(reconstruct, IsDone)) {
    CheckColmapIsThere(options, plan);
  }
  run("reconstruct", reconstruct);
  run("halves", HalvesTasks(options, plan));
  return plan;
}

}  // namespace cohort
