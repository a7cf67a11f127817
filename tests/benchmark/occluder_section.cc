#include "tests/benchmark/occluder_section.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <nlohmann/json.hpp>
#include <string_view>

#include "frontend/core/statistics.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/evaluation/evaluate.h"
#include "pipelines/experiment/degrade_clip.h"
#include "pipelines/experiment/tasks.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/track_clip.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Clip {
  const char* name;
  const char* target_px;  // after 1, 5, 10 hidden frames
};
constexpr Clip kClips[] = {
    {"room", "0.5 / 1.0 / 1.5"}, {"corridor", "0.5 / 1.3 / 2.5"}, {"tabletop", "-"}};
constexpr int kFrames = 60;
constexpr double kBarPxPerFrame = 6.0;
constexpr int kFeatures = 300;
constexpr double kEdgePx = 10.0;

// What `cohort evaluate` says of a run; of all tracks, and without those born on a depth edge.
constexpr std::string_view kAll = "all";
constexpr std::string_view kOffEdges = "off_edges";

Task MakeTask(const Clip& clip, const std::string& seed, const OccluderOptions& options) {
  const fs::path folder = options.work / clip.name / seed;
  DegradeClipOptions degrade;
  degrade.input.input = (options.clips / clip.name).string();
  degrade.input.frames = fmt::format("0:{}", kFrames);
  degrade.out = (folder / "frames").string();
  degrade.degrade.occluder_px_per_frame = kBarPxPerFrame;
  degrade.degrade.seed = static_cast<unsigned>(std::stoul(seed));
  TrackClipOptions track;
  track.input.input = degrade.out;
  track.out = (folder / "clip.tracks").string();
  track.tracker.detector.max_features = kFeatures;
  const Json depends_on{
      {"degrade", ToJson(degrade)}, {"tracker", ToJson(track.tracker)}, {"edge_px", kEdgePx}};
  track.threads = options.jobs == 1 ? 0 : 1;
  return {fmt::format("occluder {} {}", clip.name, seed),
          folder / "result.json",
          depends_on.dump(),
          [folder, degrade, track] {
            DegradeClip(degrade);
            TrackClip(track, ConsoleReport());
            Json figures;
            for (const std::string_view subject : {kAll, kOffEdges}) {
              EvaluateOptions evaluate;
              evaluate.subject = track.out;
              evaluate.truth = degrade.out;
              evaluate.edge_px = subject == kOffEdges ? kEdgePx : 0.0;
              evaluate.json = (folder / fmt::format("{}.json", subject)).string();
              Evaluate(evaluate);
              figures[std::string(subject)] = ReadJsonFile(evaluate.json);
            }
            return figures;
          }};
}

// Of one clip, one of every seed.
using Runs = std::vector<Json>;
using FigureOf = std::function<Json(const Json& run)>;  // null: there is none

std::vector<double> FiguresOf(const Runs& runs, const FigureOf& figure_of) {
  std::vector<double> figures;
  for (const Json& run : runs) {
    const Json figure = figure_of(run);
    if (!figure.is_null()) figures.push_back(figure.get<double>());
  }
  return figures;
}

// The median over the seeds (lowest-highest).
std::string Cell(const Runs& runs, const FigureOf& figure_of) {
  const std::vector<double> figures = FiguresOf(runs, figure_of);
  if (figures.empty()) return "-";
  const auto [low, high] = std::minmax_element(figures.begin(), figures.end());
  return fmt::format("{:.2f} ({:.2f}-{:.2f})", InterpolatedMedian(figures), *low, *high);
}

std::string Count(const Runs& runs, const FigureOf& figure_of) {
  const std::vector<double> figures = FiguresOf(runs, figure_of);
  return figures.empty() ? "0" : fmt::format("{:.0f}", InterpolatedMedian(figures));
}

FigureOf At(std::string_view subject, const std::string& pointer) {
  const Json::json_pointer place(fmt::format("/{}{}", subject, pointer));
  return [place](const Json& run) { return run.value(place, Json(nullptr)); };
}

std::string PositionRow(const Clip& clip,
                        const Runs& runs,
                        const char* what,
                        std::string_view subject,
                        const std::string& figure) {
  std::string counts;
  std::string cells;
  for (const int frames : {1, 5, 10}) {
    const std::string place = fmt::format("/{}/{}", figure, frames);
    counts += (counts.empty() ? "" : " / ") + Count(runs, At(subject, place + "/count"));
    cells += fmt::format(" {} |", Cell(runs, At(subject, place + "/median_px")));
  }
  return fmt::format("| {} | {} | {} |{} {} |\n", clip.name, what, counts, cells, clip.target_px);
}

std::string StateRow(const Clip& clip,
                     const Runs& runs,
                     const char* what,
                     std::string_view subject) {
  return fmt::format("| {} | {} | {} | {} | 0.95 | {} | {} | {} | {} |\n",
                     clip.name,
                     what,
                     Cell(runs, At(subject, "/predicted_precision")),
                     Cell(runs, At(subject, "/predicted_recall")),
                     Count(runs, At(subject, "/predicted/0/count")),
                     Cell(runs, At(subject, "/predicted/0/median_px")),
                     Count(runs, At(subject, "/hidden_but_observed/count")),
                     Cell(runs, At(subject, "/hidden_but_observed/median_px")));
}

}  // namespace

std::string OccluderSection(const OccluderOptions& options) {
  std::vector<Task> tasks;
  for (const Clip& clip : kClips) {
    for (const std::string& seed : options.seeds) tasks.push_back(MakeTask(clip, seed, options));
  }
  RunTasks("occluder", tasks, options.jobs, true);

  std::string positions;
  std::string states;
  auto task = tasks.begin();
  for (const Clip& clip : kClips) {
    Runs runs;
    for (std::size_t i = 0; i < options.seeds.size(); ++i, ++task) {
      const Json result = ReadJsonFile(task->result);
      if (!result.at("error").is_null()) {
        ThrowError("{}: {}", task->label, result.at("error").get<std::string>());
      }
      runs.push_back(result.at("figures"));
    }
    positions += PositionRow(clip, runs, "off edges", kOffEdges, "hidden") +
                 PositionRow(clip, runs, "predicted ones", kOffEdges, "predicted") +
                 PositionRow(clip, runs, "all", kAll, "hidden");
    states += StateRow(clip, runs, "off edges", kOffEdges) + StateRow(clip, runs, "all", kAll);
  }
  return fmt::format(
      R"(## Behind an occluder

A textured bar, 80 px wide, crosses the first {} frames of three of the clips (room: camera to the side,
corridor: ahead, tabletop: around) at {:.0f} px per frame, so that it occludes a static point for 13 frames. It is
drawn before the clip is degraded, at medium. The tracker is `subspace` as in `cohort track`, with up to {}
features; the seeds of noise and bar are {}. For the room and seed 1:

```console
$ cohort synth room --scene room --motion lateral --frames {}
$ cohort degrade room dark --level medium --occluder {:.0f} --seed 1
$ cohort track dark --detector.max-features {} --out dark.tracks
$ cohort evaluate dark.tracks --truth dark --edge-px {:.0f}
```

The first table shows the distance of a hidden point from the current position of the surface point that its track
began on, as the median over the points in the frame in which they have been hidden for 1, 5 and 10 frames in a row. A
point is hidden if it is not visible in the exact ground truth, that is, behind the bar or behind another surface. Every
position that is written counts, whatever its state, also that of a point which the tracker takes for visible. Tracks
that have ended do not count (the number of remaining points is given). Corners within {:.0f} px of a jump of depth are no
points of the scene, as above: "off edges" is without them, "all" (`--edge-px 0`) with them, and "predicted ones" are
those off edges that are called predicted.

| clip | corners | how many after 1 / 5 / 10 frames | 1 hidden frame [px] | 5 | 10 | target |
|---|---|---|---|---|---|---|
{}
The second table evaluates the state "predicted" as the statement that a point is hidden. Precision is the share of
predicted positions that are hidden; the others are visible and were not confirmed. Recall is the share of hidden
positions that are called predicted; the others are called observed (the target is for both). For both faults, the table
gives their number and their median error. Corners on the bar itself have no ground truth and count nowhere.

| clip | corners | precision | recall | target | visible, called predicted | [px] | hidden, called observed | [px] |
|---|---|---|---|---|---|---|---|---|
{})",
      kFrames,
      kBarPxPerFrame,
      kFeatures,
      fmt::join(options.seeds, ", "),
      kFrames,
      kBarPxPerFrame,
      kFeatures,
      kEdgePx,
      kEdgePx,
      positions,
      states);
}

}  // namespace cohort
