#pragma once

#include <vector>

#include "pipelines/experiment/plan.h"
#include "pipelines/experiment/tasks.h"

namespace cohort {

// The tasks of each stage of an experiment, for the cells in the plan's shard, with all their
// dependencies. Tasks refer to `options` and `plan`, which must outlive them. The list of a stage
// is made after the stages before it, since it reads their results.

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
// For the models that have been made. They are separate tasks, so that a failing half does not
// affect the model.
std::vector<Task> HalvesTasks(const ExperimentOptions& options, const ExperimentPlan& plan);

}  // namespace cohort
