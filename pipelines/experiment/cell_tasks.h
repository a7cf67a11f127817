#pragma once

#include <vector>

#include "pipelines/experiment/plan.h"
#include "pipelines/experiment/tasks.h"

namespace cohort {

// The tasks of each stage of an experiment, of the cells in the plan's shard, with all that they
// depend on. Tasks refer to `options` and `plan`, which must outlive them. The list of a stage is
// made when the stages before it are done, whose results it reads.

Task FollowTask(const ExperimentOptions& options, const TrackCell& cell);
Task TrackTask(const ExperimentOptions& options, const TrackCell& cell);
Task ModelTask(const ExperimentOptions& options, const TrackCell& cell, GridBackend backend);
Task HalvesTask(const ExperimentOptions& options, const TrackCell& cell, GridBackend backend);

// The degradation of every condition that has a cell in the shard.
std::vector<Task> DegradeTasks(const ExperimentOptions& options, const ExperimentPlan& plan);
// Protocol paper.
std::vector<Task> FollowTasks(const ExperimentOptions& options, const ExperimentPlan& plan);
std::vector<Task> TrackTasks(const ExperimentOptions& options, const ExperimentPlan& plan);
std::vector<Task> ReconstructTasks(const ExperimentOptions& options, const ExperimentPlan& plan);
// Of the models that have been made. Tasks of their own: what goes wrong with a half leaves the
// model as it is.
std::vector<Task> HalvesTasks(const ExperimentOptions& options, const ExperimentPlan& plan);

}  // namespace cohort
