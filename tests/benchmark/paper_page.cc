// Makes docs/results/paper.md and its picture: renders eight clips, compares all trackers on them
// as the paper did, and draws where features have gone.   paper_page --work DIR [--docs
// docs/results] [--jobs N] The curves of the page are penalty_weight_benchmark's; what is finished
// in DIR is not done again.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "datasets/open_sequence.h"
#include "datasets/render/synthetic_scene.h"
#include "datasets/truth/track_truth.h"
#include "frontend/storage/output.h"
#include "pipelines/experiment/collection.h"
#include "pipelines/experiment/experiment.h"
#include "pipelines/experiment/named_trackers.h"
#include "pipelines/experiment/paper_protocol.h"
#include "pipelines/experiment/paper_tables.h"
#include "pipelines/experiment/tasks.h"
#include "pipelines/json/json_file.h"
#include "tests/benchmark/occluder_section.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

struct Clip {
  SceneName scene;
  Motion motion;
};
constexpr Clip kClips[] = {{SceneName::kRoom, Motion::kLateral},
                           {SceneName::kCorridor, Motion::kForward},
                           {SceneName::kTabletop, Motion::kOrbit},
                           {SceneName::kStreet, Motion::kLateral},
                           {SceneName::kShelves, Motion::kForward},
                           {SceneName::kFacade, Motion::kLateral},
                           {SceneName::kBodies, Motion::kLateral},
                           {SceneName::kCloth, Motion::kLateral}};
constexpr int kFrames = 91;
constexpr const char* kLevels[] = {"medium", "hard"};

bool IsRigid(const Clip& clip) {
  return clip.scene != SceneName::kBodies && clip.scene != SceneName::kCloth;
}

const std::vector<std::string> kBaselines{"klt7",
                                          "klt21",
                                          "klt31",
                                          "anchored-klt21",
                                          "anchored-klt31",
                                          "rlof",
                                          "descent-paper",
                                          "descent"};

const std::vector<std::string> kOurs{"subspace-paper", "subspace"};

// subspace with these trajectory models.
struct TrajectoryModelKind {
  const char* name;
  bool perspective;
  int max_rank;
  const char* text;
};
constexpr TrajectoryModelKind kTrajectoryModels[] = {
    {"affine-3", false, 3, "affine, at most 3"},
    {"affine-8", false, 8, "affine, at most 8"},
    {"projective-3", true, 3, "projective, at most 3"},
    {"projective-8", true, 8, "projective, at most 8"}};

struct PageOptions {
  fs::path work;
  fs::path docs = "docs/results";
  std::vector<std::string> seeds{"1", "2", "3"};
  int jobs = 1;
};

std::vector<std::string> RenderClips(const PageOptions& options) {
  std::vector<std::string> clips;
  std::vector<Task> tasks;
  for (const Clip& clip : kClips) {
    const std::string name(NameOf(kSceneNames, clip.scene));
    const fs::path folder = options.work / "clips" / name;
    clips.push_back(folder.string());
    SyntheticSceneOptions scene;
    scene.scene = clip.scene;
    scene.motion = clip.motion;
    scene.frames = kFrames;
    const std::string motion(NameOf(kMotionNames, clip.motion));
    tasks.push_back({"render " + name,
                     options.work / "clips" / (name + ".json"),
                     nlohmann::json{{"motion", motion}, {"frames", kFrames}}.dump(),
                     [scene, folder] {
                       RenderSequence(scene, folder);
                       return nlohmann::ordered_json::object();
                     }});
  }
  RunTasks("render", tasks, 1, true);
  return clips;
}

struct PageResults {
  ExperimentResults trackers;
  ExperimentResults trajectory_models;
  std::string occluder_section;
};

PageResults Compare(const PageOptions& options, const std::vector<std::string>& clips) {
  ExperimentOptions experiment;
  experiment.protocol = Protocol::kPaper;
  experiment.inputs = clips;
  experiment.out = (options.work / "compare").string();
  experiment.levels = {std::begin(kLevels), std::end(kLevels)};
  experiment.seeds = options.seeds;
  experiment.jobs = options.jobs;
  experiment.resume = true;
  experiment.trackers = kBaselines;
  experiment.trackers.insert(experiment.trackers.end(), kOurs.begin(), kOurs.end());
  PageResults results;
  results.trackers = CollectResults(experiment, RunCells(experiment));
  results.occluder_section = OccluderSection({.clips = options.work / "clips",
                                              .work = options.work / "occluder",
                                              .seeds = options.seeds,
                                              .jobs = options.jobs});
  experiment.trackers.clear();
  for (const TrajectoryModelKind& model : kTrajectoryModels) {
    const fs::path file = options.work / fmt::format("{}.json", model.name);
    WriteJsonFile(
        file,
        {{"tracker", "subspace"},
         {"measurement", {{"perspective", model.perspective}, {"max_rank", model.max_rank}}}});
    experiment.trackers.push_back(file.string());
  }
  results.trajectory_models = CollectResults(experiment, RunCells(experiment));
  return results;
}

// What perspective and further dimensions gain over the paper's affine subspace of three.
std::string TrajectoryModelTable(const ExperimentResults& results, const char* metric) {
  struct Group {
    const char* text;
    std::function<bool(const Clip&)> has;
  };
  const Group groups[] = {
      {"all eight", [](const Clip&) { return true; }},
      {"six rigid", IsRigid},
      {"of these two ahead", [](const Clip& c) { return c.motion == Motion::kForward; }},
      {"two not rigid", [](const Clip& c) { return !IsRigid(c); }}};
  const bool high_is_good = metric == kFramesBetweenMetric;
  const char* const gain = high_is_good ? "this / affine 3" : "affine 3 / this";
  std::string text = fmt::format(
      "| clips | cameras, dimensions | medium | {} | hard | {} |\n|---|---|---|---|---|---|\n",
      gain,
      gain);
  for (const Group& group : groups) {
    std::vector<std::string> sequences;
    for (const Clip& clip : kClips) {
      if (group.has(clip)) sequences.emplace_back(NameOf(kSceneNames, clip.scene));
    }
    for (const TrajectoryModelKind& model : kTrajectoryModels) {
      text += fmt::format("| {} | {} |", group.text, model.text);
      for (const char* level : kLevels) {
        const auto affine = AverageOf(results, level, metric, kTrajectoryModels[0].name, sequences);
        const auto own = AverageOf(results, level, metric, model.name, sequences);
        if (!affine || !own) {
          text += " FAILED | - |";
          continue;
        }
        text +=
            fmt::format(" {:.1f} | {:.2f} |", *own, high_is_good ? *own / *affine : *affine / *own);
      }
      text += "\n";
    }
  }
  return text;
}

std::string RatioTable(const ExperimentResults& results, const std::string& level) {
  struct Figure {
    const char* text;
    const char* metric;
    const char* other;
    const char* in_paper;
    bool high_is_good;
  };
  constexpr const char* kL1 = kL1ErrorMetric;
  constexpr const char* kLife = kFramesBetweenMetric;
  const Figure figures[] = {
      {"L1 error, KLT 7x7 / ours", kL1, "klt7", "13.8 (its KLT)", false},
      {"L1 error, KLT 21x21 / ours", kL1, "klt21", "", false},
      {"L1 error, KLT 31x31 / ours", kL1, "klt31", "", false},
      {"L1 error, anchored KLT 21x21 / ours", kL1, "anchored-klt21", "", false},
      {"L1 error, anchored KLT 31x31 / ours", kL1, "anchored-klt31", "", false},
      {"L1 error, first-order descent / ours", kL1, "descent-paper", "1.55", false},
      {"frames between re-initialisations, ours / KLT 7x7", kLife, "klt7", "7.8", true},
      {"the same, ours / KLT 31x31", kLife, "klt31", "", true},
      {"the same, ours / anchored KLT 31x31", kLife, "anchored-klt31", "", true},
      {"the same, ours / first-order descent", kLife, "descent-paper", "1.86", true}};
  std::string text = "| figure | the paper |";
  std::string rule = "|---|---|";
  for (const std::string& ours : kOurs) {
    text += fmt::format(" `{}` |", ours);
    rule += "---|";
  }
  text += "\n" + rule + "\n";
  for (const Figure& figure : figures) {
    text += fmt::format("| {} | {} |", figure.text, figure.in_paper);
    for (const std::string& ours : kOurs) {
      const auto ratio = figure.high_is_good
                             ? RatioOfAverages(results, level, figure.metric, ours, figure.other)
                             : RatioOfAverages(results, level, figure.metric, figure.other, ours);
      text += ratio ? fmt::format(" {:.2f} |", *ratio) : " - |";
    }
    text += "\n";
  }
  text += "| sequences of 8 with a smaller L1 error than every baseline | 6 |";
  for (const std::string& ours : kOurs) {
    text += fmt::format(" {} |", SequencesWon(results, level, ours, kBaselines));
  }
  return text + "\n";
}

std::string RatioTables(const ExperimentResults& results) {
  std::string text;
  for (const char* level : kLevels) {
    text += fmt::format(
        "{}Level {}:\n\n{}", text.empty() ? "" : "\n", level, RatioTable(results, level));
  }
  return text;
}

// A dark frame, twice as bright; where the features are (green) and where they ought to be (red).
cv::Mat Draw(const cv::Mat& gray,
             const std::vector<FollowedPoint>& points,
             std::size_t frame,
             const std::vector<Eigen::Vector2d>& xy,
             const std::string& title) {
  cv::Mat picture;
  gray.convertTo(picture, CV_8U, 2.0);
  cv::cvtColor(picture, picture, cv::COLOR_GRAY2BGR);
  const cv::Scalar red(60, 60, 255);
  const cv::Scalar green(80, 230, 80);
  const auto pixel = [](const Eigen::Vector2d& p) { return cv::Point2d(p.x(), p.y()); };
  for (std::size_t f = 0; f < xy.size(); ++f) {
    const cv::Point truth = pixel(points[f].xy[frame]);
    cv::line(picture, truth, pixel(xy[f]), green, 1, cv::LINE_AA);
    cv::drawMarker(picture, truth, red, cv::MARKER_CROSS, 9, 1, cv::LINE_AA);
    cv::circle(picture, pixel(xy[f]), 4, green, 1, cv::LINE_AA);
  }
  cv::putText(
      picture, title, {8, 20}, cv::FONT_HERSHEY_SIMPLEX, 0.55, {255, 255, 255}, 1, cv::LINE_AA);
  return picture;
}

// KLT to the left, the joint tracker to the right.
void WritePicture(const PageOptions& options, const fs::path& clip, const fs::path& file) {
  PaperProtocolOptions protocol;
  const auto bright = OpenSequence(clip);
  const auto truth = OpenTrackTruth(*bright, clip);
  const auto points = ChoosePoints(*bright, *truth, {}, protocol);
  const auto dark = OpenSequence(options.work / "compare/cells" / clip.filename() / "hard" /
                                 options.seeds.front() / "frames");
  std::vector<cv::Mat> pictures;
  for (const char* name : {"klt21", "subspace"}) {
    const auto mover = MakeMover(WithoutGivingUp(NamedTracker(name, {})));
    dark->Rewind();
    cv::Mat last;
    const auto next = [&] {
      auto frame = dark->Next();
      if (frame) last = frame->gray;
      return frame;
    };
    const auto frames = static_cast<std::size_t>(protocol.window_frames);
    const TrajectoryRun run = RunTrajectories(*mover, next, points, frames);
    pictures.push_back(Draw(last,
                            points,
                            frames,
                            run.last_xy,
                            fmt::format("{}: mean L1 error {:.0f} px", name, run.mean_l1_px)));
  }
  cv::Mat row;
  cv::hconcat(pictures, row);
  OutputFile out(file);
  std::vector<std::uint8_t> bytes;
  Check(cv::imencode(".jpg", row, bytes, {cv::IMWRITE_JPEG_QUALITY, 85}), "OpenCV writes JPEG");
  WriteBytes(out.partial(), std::string(bytes.begin(), bytes.end()));
  out.Commit();
}

std::string Page(const PageResults& all, const PageOptions& options) {
  const ExperimentResults& results = all.trackers;
  double fewest = 1e9;
  double most = 0.0;
  for (const ResultRow& row : results.rows) {
    if (row.metric != "features") continue;
    fewest = std::min(fewest, row.value);
    most = std::max(most, row.value);
  }
  return fmt::format(
      R"(# The paper's experiments, repeated

Poling, Lerman, Szlam: Better Feature Tracking Through Subspace Constraints, CVPR 2014, section 4. This page and its
pictures are written by

```console
$ paper_page --work WORK --docs docs/results
$ penalty_weight_benchmark WORK/clips/room WORK/clips/corridor WORK/clips/street --work WORK/weights \
    --svg docs/results/penalty_weight.svg
```

which are built in `build/tests/benchmark`. The first also renders the clips. The comparison alone is `cohort compare
CLIP... --protocol paper --levels medium,hard --seeds 1,2,3 --trackers klt7,klt21,subspace --out DIR`.

![The same dark frame, KLT left, the joint tracker right](paper_tracks.jpg)

*Room, level hard, shown twice as bright, after 30 frames. Red marks the ground-truth positions of the points. Green
marks their positions according to KLT 21x21 (left) and the joint tracker (right), and their errors.*

## Protocol

The clips are eight rendered ones of {} frames, 640 x 480, with exact ground truth. Six are rigid (room, street,
facade: camera to the side; corridor, shelves: ahead; tabletop: around), one has several rigid bodies (bodies), and one
deforms (cloth). They are darkened, noised, blurred and noised again, as in the paper, which does not print its amounts.
Here medium is 30 % of the light, with noise of .04 before and .02 after a blur of 2 px; hard is 20 %, .06 and .03 (of
the full range). The seeds of the noise are {}.

- **Points.** As in the paper, the points are chosen in the clip before it is degraded, so that there are strong and
  weak ones: up to 100 corners of the common detector in frame 0, and in frames 30 and 60 as many as are missing to 100.
  Points are used if they show a surface, have no jump of depth within 10 px (a near edge crossing a far one is no point
  of the scene), and stay visible and 16 px off the border for 30 more frames: {} to {} from frame 0 on. They are
  followed until they are hidden or near the border for the first time. All trackers get the same points, at their true
  positions.
- **Mean L1 trajectory error after 30 frames.** For the points of frame 0, the sum over 30 frames of |dx| + |dy|, as a
  mean over features.
- **Mean frames between re-initialisations.** A feature more than 10 px off is started again at its true position. The
  figure is the number of feature-frames within 10 px over the number of re-initialisations. ">" means that there was
  none, so the figure is at least that large.
- **Lost features are failures, not omissions.** A feature that a tracker gives up stays at its last position (first
  figure) or counts as re-initialised (second). The trackers' own checks by which features end (tracking back) are off,
  so neither figure rewards giving up.
- A cell is the median over the seeds and (lowest-highest); the average is that of the medians.

The trackers are:

- `klt7`, `klt21`, `klt31`: OpenCV's pyramidal Lucas-Kanade at three windows.
- `anchored-klt21`, `anchored-klt31`: the same from frame to frame as a guide, then once more against the feature's
  first frame. The result is kept if it ends within 3 px of the guide and tracks back to 1 px; otherwise the guide is
  used. The gain of our trackers over these is therefore not due to measuring against the first frame.
- `rlof`: OpenCV's robust local optical flow.
- `descent-paper`, `subspace-paper`: the paper's first-order tracker and its joint tracker (empirical dimension,
  centred, weak, L = 10, Algorithm 1), templates 7 x 7, without measurement. m, which the paper does not print, is
  relative to the contrast and chosen as below.
- `descent`: the same first-order tracker with templates 11 x 11.
- `subspace`: the tracker of `cohort track`: Lucas-Kanade as a guide, then a separate measurement of every feature, and
  a trajectory model of all of them.

## Summary

The figures are ratios of the averages over the eight clips.

{}
## The two tables, and how many times better

```text
{}```

## Beyond affine

The paper's subspace is that of an affine camera and one rigid body, which has three dimensions when centred.
Perspective, motion ahead and further bodies need more. The trajectory model (`docs/how_it_works.md`) has two solutions:
projective cameras (`--measurement.perspective`), and coordinates that start at two and are added whenever the residuals
contain a direction that noise does not explain; `--measurement.max-rank` is the maximum, 3 or 8. The tables show
`subspace` with each, with seeds {} and averages over the clips, first the L1 error, then the frames between
re-initialisations:

{}
{}
The last, projective with at most 8, is the default, since reconstructed scenes are mostly rigid. On rigid scenes at
medium, perspective with three dimensions achieves what affine cameras need further dimensions for, and more; at hard
both together are best. Several bodies and deforming scenes need the further dimensions. There, affine cameras with at
most 8 are better, most clearly at hard.

{}
## Sensitivity to the weight of the penalty

![L1 error against m, for three penalties, weak and strong](penalty_weight.svg)

The plots show the error of the guide alone (no measurement) over m of eq. (7), on room, corridor and street, at three
levels of darkness. One m serves all levels: the m above each plot is the one at which its worst level loses least
against that level's own best m.
)",
      kFrames,
      fmt::join(options.seeds, ", "),
      fewest,
      most,
      RatioTables(results),
      PaperTables(results),
      fmt::join(options.seeds, ", "),
      TrajectoryModelTable(all.trajectory_models, kL1ErrorMetric),
      TrajectoryModelTable(all.trajectory_models, kFramesBetweenMetric),
      all.occluder_section);
}

void MakePage(const PageOptions& options) {
  const std::vector<std::string> clips = RenderClips(options);
  const PageResults results = Compare(options, clips);
  fs::create_directories(options.docs);
  WritePicture(options, clips.front(), options.docs / "paper_tracks.jpg");
  OutputFile page(options.docs / "paper.md");
  WriteBytes(page.partial(), Page(results, options));
  page.Commit();
  fmt::print("{}\n{}", RatioTables(results.trackers), PaperTables(results.trackers));
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  CLI::App app("Makes the page of the paper's experiments");
  cohort::PageOptions options;
  app.add_option("--work", options.work, "folder for clips and results")->required();
  app.add_option("--docs", options.docs, "folder for the page");
  app.add_option("--seeds", options.seeds, "of the noise")->delimiter(',');
  app.add_option("--jobs", options.jobs, "processes at a time");
  CLI11_PARSE(app, argc, argv);
  try {
    cohort::MakePage(options);
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 1;
  }
  return 0;
}
