#include "pipelines/experiment/cell_tasks.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipelines/experiment/cell_jobs.h"
#include "pipelines/experiment/cell_rows.h"
#include "pipelines/experiment/degrade_clip.h"
#include "pipelines/experiment/named_trackers.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/fingerprint.h"

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;

std::string LabelOf(const Condition& condition) {
  return fmt::format("{} {} {}", condition.clip.name, condition.level, condition.seed);
}

std::string LabelOf(const TrackCell& cell, GridBackend backend) {
  return fmt::format(
      "{} {} {}", NameOf(kGridBackendNames, backend), LabelOf(cell.condition), cell.tracker.name);
}

// Independent of the spelling of its path.
Json DependencyOf(InputOptions clip) {
  clip.input = CanonicalPath(clip.input);
  return ToJson(clip);
}

// The frames and everything that is applied to them.
Json DependenciesOf(const ExperimentOptions& options, const TrackCell& cell) {
  Json depends_on{{"clip", DependencyOf(ClipInput(options, cell.condition))},
                  {"fingerprint", cell.condition.clip.fingerprint},
                  {"level", cell.condition.level},
                  {"seed", cell.condition.seed},
                  {"tracker", OwnOptions(cell.tracker)}};
  if (options.protocol == Protocol::kReconstruction && HasSecondPass(cell.tracker)) {
    depends_on["second_pass"] = ToJson(options.second_pass);
  }
  if (!options.mask.empty()) {
    depends_on["mask"] = {CanonicalPath(options.mask), FingerprintOfMasks(options.mask)};
  }
  return depends_on;
}

Json BackendOptions(const ExperimentOptions& options, const TrackCell& cell, GridBackend backend) {
  switch (backend) {
    case GridBackend::kCeres:
    case GridBackend::kTriangulation:
      return {{"ceres", ToJson(options.ceres)}};
    case GridBackend::kColmap:
      Json colmap{{"colmap", ToJson(ColmapOptionsOf(options, cell))}};
      if (cell.tracker.source == TrackSource::kSift) {
        colmap["sift"] = ToJson(SiftOptionsOf(options));
      } else {
        colmap["ceres"] = ToJson(options.ceres);  // for camera, shutter and initial model
      }
      return colmap;
  }
  ThrowUsageError("unknown backend");
}

std::string ModelDependenciesOf(const ExperimentOptions& options,
                                const TrackCell& cell,
                                GridBackend backend) {
  Json depends_on = DependenciesOf(options, cell);
  depends_on["backend"] = BackendOptions(options, cell, backend);
  return JsonLine(depends_on);
}

}  // namespace

std::vector<Task> DegradeTasks(const ExperimentOptions& options, const ExperimentPlan& plan) {
  std::vector<Task> tasks;
  for (std::size_t i = 0; i < plan.conditions.size(); ++i) {
    bool needed = false;
    for (std::size_t t = 0; t < plan.trackers.size(); ++t) {
      needed = needed || plan.shard.Takes(i * plan.trackers.size() + t);
    }
    const Condition& condition = plan.conditions[i];
    if (!needed || !condition.IsDegraded()) continue;
    DegradeClipOptions degrade;
    degrade.input = ClipInput(options, condition);
    degrade.out = condition.Frames().string();
    degrade.degrade = DegradationOf(condition);
    degrade.level = condition.DegradeLevel();
    DegradeClipOptions named = degrade;
    named.input.input = CanonicalPath(degrade.input.input);
    named.out.clear();
    const Json depends_on{{"degrade", ToJson(named)}, {"fingerprint", condition.clip.fingerprint}};
    tasks.push_back({"degrade " + LabelOf(condition),
                     condition.folder / "degrade.json",
                     JsonLine(depends_on),
                     [degrade] {
                       DegradeClip(degrade);
                       return Json::object();
                     },
                     !options.shard.empty(),
                     condition.Frames()});
  }
  return tasks;
}

Task FollowTask(const ExperimentOptions& options, const TrackCell& cell) {
  Json depends_on = DependenciesOf(options, cell);
  depends_on["paper"] = ToJson(options.paper);
  return {fmt::format("follow {} {}", LabelOf(cell.condition), cell.tracker.name),
          cell.Result(),
          JsonLine(depends_on),
          [&options, &cell] { return FollowCell(options, cell); }};
}

Task TrackTask(const ExperimentOptions& options, const TrackCell& cell) {
  return {.label = fmt::format("track {} {}", LabelOf(cell.condition), cell.tracker.name),
          .result = cell.Result(),
          .options = JsonLine(DependenciesOf(options, cell)),
          .run = [&options, &cell] { return MakeTracks(options, cell); },
          .makes = cell.Tracks()};
}

Task ModelTask(const ExperimentOptions& options, const TrackCell& cell, GridBackend backend) {
  return {LabelOf(cell, backend),
          cell.Result(backend),
          ModelDependenciesOf(options, cell, backend),
          [&options, &cell, backend] { return ReconstructCell(options, cell, backend); }};
}

Task HalvesTask(const ExperimentOptions& options, const TrackCell& cell, GridBackend backend) {
  return {"halves " + LabelOf(cell, backend),
          cell.HalvesResult(backend),
          ModelDependenciesOf(options, cell, backend),
          [&options, &cell, backend] { return CompareHalvesOfCell(options, cell, backend); }};
}

std::vector<Task> FollowTasks(const ExperimentOptions& options, const ExperimentPlan& plan) {
  std::vector<Task> tasks;
  for (std::size_t i = 0; i < plan.cells.size(); ++i) {
    if (!plan.shard.Takes(i)) continue;
    tasks.push_back(FollowTask(options, plan.cells[i]));
  }
  return tasks;
}

std::vector<Task> TrackTasks(const ExperimentOptions& options, const ExperimentPlan& plan) {
  std::vector<Task> tasks;
  for (std::size_t i = 0; i < plan.cells.size(); ++i) {
    const TrackCell& cell = plan.cells[i];
    if (!plan.shard.Takes(i) || cell.tracker.source == TrackSource::kSift) continue;
    tasks.push_back(TrackTask(options, cell));
  }
  return tasks;
}

std::vector<Task> ReconstructTasks(const ExperimentOptions& options, const ExperimentPlan& plan) {
  std::vector<Task> tasks;
  for (std::size_t i = 0; i < plan.cells.size(); ++i) {
    if (!plan.shard.Takes(i)) continue;
    const TrackCell& cell = plan.cells[i];
    const bool has_tracks = cell.tracker.source != TrackSource::kSift;
    if (has_tracks && IsNotAvailable(cell.Result())) continue;
    for (const GridBackend backend : plan.backends) {
      if (cell.Has(backend)) tasks.push_back(ModelTask(options, cell, backend));
    }
  }
  return tasks;
}

std::vector<Task> HalvesTasks(const ExperimentOptions& options, const ExperimentPlan& plan) {
  std::vector<Task> tasks;
  if (!plan.halves) return tasks;
  for (std::size_t i = 0; i < plan.cells.size(); ++i) {
    if (!plan.shard.Takes(i)) continue;
    const TrackCell& cell = plan.cells[i];
    for (const GridBackend backend : plan.backends) {
      if (!cell.HasHalves(backend)) continue;
      if (HasModel(cell.Result(backend))) tasks.push_back(HalvesTask(options, cell, backend));
    }
  }
  return tasks;
}

}  // namespace cohort
