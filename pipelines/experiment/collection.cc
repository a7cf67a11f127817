#include "pipelines/experiment/collection.h"

#include <nlohmann/json.hpp>

#include "pipelines/experiment/cell_rows.h"
#include "pipelines/experiment/cell_tasks.h"
#include "pipelines/experiment/named_trackers.h"
#include "pipelines/experiment/undegraded.h"
#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// The cell of the last plain KLT on the undegraded clip with the first seed; null if the grid has
// none.
const TrackCell* FindUndegradedReference(const ExperimentPlan& plan, const GridClip& clip) {
  const TrackCell* reference = nullptr;
  for (const TrackCell& other : plan.cells) {
    if (!other.condition.IsDegraded() && other.condition.clip.name == clip.name &&
        other.condition.seed == plan.seeds.front() && IsPlainKlt(other.tracker)) {
      reference = &other;
    }
  }
  return reference;
}

// Adds, for real clips, the error against the reconstruction of the undegraded frames, if the grid
// has one. All trackers share one reference, that of an opponent: the last plain KLT.
void AddUndegradedRow(const ExperimentOptions& options,
                      const ExperimentPlan& plan,
                      const TrackCell& cell,
                      GridBackend backend,
                      ExperimentResults& results) {
  const GridClip& clip = cell.condition.clip;
  if (!clip.has_poses || clip.has_track_truth || !cell.condition.IsDegraded() ||
      backend == GridBackend::kTriangulation) {
    return;
  }
  const TrackCell* reference = FindUndegradedReference(plan, clip);
  if (reference == nullptr || !HasResult(ModelTask(options, *reference, backend))) return;
  const auto frames = OpenInput(reference->frames);
  const auto error =
      ErrorToUndegraded(cell.Model(backend), reference->Model(backend), frames->TrueCamFromWorld());
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

}  // namespace

bool HasOwnResult(const ExperimentOptions& options, const TrackCell& cell) {
  return HasResult(options.protocol == Protocol::kPaper ? FollowTask(options, cell)
                                                        : TrackTask(options, cell));
}

ExperimentResults CollectResults(const ExperimentOptions& options, const ExperimentPlan& plan) {
  ExperimentResults results;
  for (const TrackCell& cell : plan.cells) {
    TrackCell& collected = results.cells.emplace_back(cell);
    if (HasOwnResult(options, cell)) {
      collected.is_tracked = true;
      UseJsonFile(cell.Result(), [&](const Json& json) { AddTrackRows(cell, json, results); });
    }
    // Existing models belong to the other protocol.
    if (options.protocol == Protocol::kPaper) continue;
    for (const GridBackend backend : plan.backends) {  // missing results belong to another shard
      if (!HasResult(ModelTask(options, cell, backend))) continue;
      collected.modelled.push_back(backend);
      UseJsonFile(cell.Result(backend), [&](const Json& result) {
        AddModelRows(cell, backend, result, results);
        if (!plan.halves || !cell.HasHalves(backend)) return;
        const fs::path halves = cell.HalvesResult(backend);
        if (!HasResult(HalvesTask(options, cell, backend))) {
          AddHalvesRows(cell, backend, result, nullptr, results);
          return;
        }
        UseJsonFile(halves,
                    [&](const Json& json) { AddHalvesRows(cell, backend, result, json, results); });
      });
      AddUndegradedRow(options, plan, cell, backend, results);
    }
  }
  return results;
}

}  // namespace cohort
