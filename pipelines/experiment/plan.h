#pragma once

#include <filesystem>
#include <vector>

#include "datasets/degrade/degrade.h"
#include "frontend/storage/write_lock.h"
#include "pipelines/experiment/cells.h"
#include "pipelines/experiment/experiment.h"

namespace cohort {

// Every n-th cell.
struct Shard {
  std::size_t index = 0;
  std::size_t count = 1;

  bool Takes(std::size_t i) const { return i % count == index; }
};

// The work of an experiment, from its options.
struct ExperimentPlan {
  std::filesystem::path cells_folder;
  Shard shard;
  bool halves = true;  // whether halves of the tracks are compared
  std::vector<GridTracker> trackers;
  std::vector<GridBackend> backends;
  std::vector<unsigned> seeds;
  std::vector<Condition> conditions;  // clips x levels x seeds
  std::vector<TrackCell> cells;       // conditions x trackers, in this order
  std::vector<WriteLock> locks;       // held until the results are written
};

// All but conditions and cells, which need the clips. Throws UsageError if the options form no
// grid.
ExperimentPlan PlanWithoutClips(const ExperimentOptions& options);
void AddClips(const ExperimentOptions& options,
              const std::vector<GridClip>& clips,
              ExperimentPlan& plan);

// Opens the clips in separate processes, because opening one may start OpenCV's threads, and this
// process will fork. Throws Error if a clip cannot be opened or does not suit the protocol.
std::vector<GridClip> ProbeClips(const ExperimentOptions& options, const ExperimentPlan& plan);

// The clip itself, and its degradation.
InputOptions ClipInput(const ExperimentOptions& options, const Condition& condition);
DegradeOptions DegradationOf(const Condition& condition);

}  // namespace cohort
