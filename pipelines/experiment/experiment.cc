#include "pipelines/experiment/experiment.h"

#include <filesystem>
#include <system_error>

#include "pipelines/experiment/cell_tasks.h"
#include "pipelines/experiment/collection.h"
#include "pipelines/experiment/plan.h"
#include "pipelines/experiment/tasks.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

void MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) ThrowError("cannot make folder {}: {}", folder.string(), error.message());
}

}  // namespace

ExperimentResults RunExperiment(const ExperimentOptions& options) {
  ExperimentPlan plan = PlanWithoutClips(options);
  MakeFolder(plan.cells_folder);
  const std::vector<GridClip> clips = ProbeClips(options, plan);
  // Not before the inputs are known to be good. Other shards may be at work in the same folder.
  if (!options.resume && options.shard.empty()) {
    fs::remove_all(plan.cells_folder);
    MakeFolder(plan.cells_folder);
  }
  AddClips(options, clips, plan);

  const auto run = [&options](const char* stage, const std::vector<Task>& tasks) {
    RunTasks(stage, tasks, options.jobs, options.resume);
  };
  run("degrade", DegradeTasks(options, plan));
  if (options.protocol == Protocol::kPaper) {
    run("follow", FollowTasks(options, plan));
    return CollectResults(plan);
  }
  run("track", TrackTasks(options, plan));
  run("reconstruct", ReconstructTasks(options, plan));
  run("halves", HalvesTasks(options, plan));
  return CollectResults(plan);
}

}  // namespace cohort
