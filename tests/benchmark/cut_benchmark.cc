// Which cuts are found, and what is taken for one: docs/results/cuts.md.
//   cut_benchmark --tuned CLIP ... --other CLIP ... [--dark-frames 100]
//   cut_benchmark --cost CLIP
//  Every clip is cut to 4:3 and scaled to 640 x 480, as it is (day) and degraded in two ways at the
// level hard (of the dark ones the first frames only, as degrading takes most of the time). Joints:
// three frames of one clip up to each fifth of it, then two of another; every ordered pair of
// clips. Found: SceneWatch says so at the first frame of the other, or holds that one for blank and
// says so at the second. Uncut: all frames of a clip, and every third of them; each kCut is false.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <iostream>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/degrade/degrade.h"
#include "datasets/open_sequence.h"
#include "frontend/core/error.h"
#include "frontend/core/in_parallel.h"
#include "frontend/core/part_times.h"
#include "frontend/core/statistics.h"
#include "frontend/track/loop/scene_watch.h"
#include "frontend/track/tracker.h"

namespace cohort {
namespace {

constexpr std::array<std::string_view, 3> kLights{"day", "paper, hard", "sensor, hard"};
constexpr std::size_t kPlaces = 4;

using Film = std::vector<cv::Mat>;  // CV_8UC1, 640 x 480

Film ReadFilm(const std::string& path) {
  const auto sequence = OpenSequence(path);
  Film film;
  while (const auto frame = sequence->Next()) {
    const cv::Mat& gray = frame->gray;
    const double unit = std::min(gray.cols / 4.0, gray.rows / 3.0);
    const cv::Size size(static_cast<int>(4 * unit), static_cast<int>(3 * unit));
    const cv::Rect middle(
        (gray.cols - size.width) / 2, (gray.rows - size.height) / 2, size.width, size.height);
    cv::Mat& picture = film.emplace_back();
    cv::resize(gray(middle),
               picture,
               cv::Size(640, 480),
               0.0,
               0.0,
               size.width > 640 ? cv::INTER_AREA : cv::INTER_LINEAR);
    if (picture.depth() == CV_16U) picture.convertTo(picture, CV_8U, 1.0 / 257.0);
  }
  return film;
}

Film InLight(Film film, std::size_t light, std::size_t dark_frames) {
  if (light == 0) return film;
  film.resize(std::min(film.size(), dark_frames));
  DegradeOptions options;
  options.recipe = light == 1 ? DegradeRecipe::kPaper : DegradeRecipe::kSensor;
  options.level = ParseLevel("hard");
  ForEachInParallel(film.size(), [&](std::size_t i) {
    film[i] = DegradeFrame(film[i], options, static_cast<std::uint32_t>(i));
  });
  return film;
}

std::vector<SceneChange> Watch(const Film& film) {
  SceneWatch watch;
  std::vector<SceneChange> changes;
  for (const cv::Mat& picture : film) changes.push_back(watch.Follow(BuildPyramid(picture)));
  return changes;
}

struct Count {
  std::size_t of = 0;
  std::size_t cuts = 0;

  void Add(bool is_cut) {
    ++of;
    if (is_cut) ++cuts;
  }
  std::string Text() const { return fmt::format("{} of {}", cuts, of); }
};

// Of every step-th frame, from each of the first ones on.
void CountCuts(const Film& film, std::size_t step, Count& count) {
  for (std::size_t first = 0; first < step; ++first) {
    Film thinned;
    for (std::size_t i = first; i < film.size(); i += step) thinned.push_back(film[i]);
    const std::vector<SceneChange> changes = Watch(thinned);
    for (std::size_t i = 1; i < changes.size(); ++i) count.Add(changes[i] == SceneChange::kCut);
  }
}

// What joints take of a clip: at each place three frames that end there and two that begin there.
struct Places {
  std::array<Film, kPlaces> ends;
  std::array<Film, kPlaces> begins;
};

Places PlacesOf(const Film& film) {
  Places places;
  for (std::size_t k = 0; k < kPlaces; ++k) {
    const auto at = static_cast<std::ptrdiff_t>(film.size() * (k + 1) / (kPlaces + 1));
    places.ends[k] = {film.begin() + at - 2, film.begin() + at + 1};
    places.begins[k] = {film.begin() + at, film.begin() + at + 2};
  }
  return places;
}

bool IsFound(const Film& before, const Film& behind) {
  Film joined = before;
  joined.insert(joined.end(), behind.begin(), behind.end());
  const std::vector<SceneChange> changes = Watch(joined);
  return changes[3] == SceneChange::kCut ||
         (changes[3] == SceneChange::kBlank && changes[4] == SceneChange::kCut);
}

void Run(const std::vector<std::string>& clips, std::size_t tuned, std::size_t dark_frames) {
  struct Figures {
    std::array<Count, 2> joints;  // of clips that the thresholds were tuned on alone; with others
    std::array<Count, 2> uncut;   // of clips that they were tuned on; of others
    std::array<Count, 2> thirds;
  };
  std::array<Figures, kLights.size()> figures;
  std::array<std::vector<Places>, kLights.size()> places;
  for (std::size_t c = 0; c < clips.size(); ++c) {
    const Film film = ReadFilm(clips[c]);
    if (film.size() < 20) ThrowError("{} has {} frames: give one of 20", clips[c], film.size());
    for (std::size_t light = 0; light < kLights.size(); ++light) {
      const Film lit = InLight(film, light, dark_frames);
      Count uncut;
      Count thirds;
      CountCuts(lit, 1, uncut);
      CountCuts(lit, 3, thirds);
      fmt::print(stderr,
                 "{}, {}: {}; every third: {}\n",
                 clips[c],
                 kLights[light],
                 uncut.Text(),
                 thirds.Text());
      const std::size_t group = c < tuned ? 0 : 1;
      figures[light].uncut[group].of += uncut.of;
      figures[light].uncut[group].cuts += uncut.cuts;
      figures[light].thirds[group].of += thirds.of;
      figures[light].thirds[group].cuts += thirds.cuts;
      places[light].push_back(PlacesOf(lit));
    }
  }
  for (std::size_t light = 0; light < kLights.size(); ++light) {
    for (std::size_t a = 0; a < clips.size(); ++a) {
      for (std::size_t b = 0; b < clips.size(); ++b) {
        if (a == b) continue;
        for (std::size_t k = 0; k < kPlaces; ++k) {
          const bool found =
              IsFound(places[light][a].ends[k], places[light][b].begins[kPlaces - 1 - k]);
          figures[light].joints[a < tuned && b < tuned ? 0 : 1].Add(found);
          if (!found) fmt::print(stderr, "{}: {} > {}\n", kLights[light], clips[a], clips[b]);
        }
      }
    }
  }
  fmt::print("| light | clips | joints found | uncut, taken for cuts | of every third frame |\n");
  fmt::print("|---|---|---|---|---|\n");
  for (std::size_t light = 0; light < kLights.size(); ++light) {
    for (const std::size_t group : {0, 1}) {
      fmt::print("| {} | {} | {} | {} | {} |\n",
                 kLights[light],
                 group == 0 ? "tuned on" : "others",
                 figures[light].joints[group].Text(),
                 figures[light].uncut[group].Text(),
                 figures[light].thirds[group].Text());
    }
  }
}

// ---- what it costs ----

struct TrackRun {
  double cpu_ms = 0.0;    // a frame
  double watch_ms = 0.0;  // of it, SceneWatch
  std::vector<Eigen::Vector2d> positions;
};

TrackRun TrackFilm(const Film& film, TrackerOptions options, bool cuts) {
  options.cuts = cuts;
  const auto tracker = MakeTracker(options);
  TrackRun run;
  const PartTimes times;
  const double start = ThreadCpuMs();
  for (std::size_t i = 0; i < film.size(); ++i) {
    Frame frame;
    frame.index = FrameIndex{static_cast<std::uint32_t>(i)};
    frame.gray = film[i];
    for (const Observation& o : tracker->Track(frame).observations) run.positions.push_back(o.xy);
  }
  run.cpu_ms = (ThreadCpuMs() - start) / static_cast<double>(film.size());
  const auto watch = times.ms().find("scene watch");
  if (watch != times.ms().end()) run.watch_ms = watch->second / static_cast<double>(film.size());
  return run;
}

// With and without in turn, on one thread: the median of the ratios of neighbours.
void PrintCost(const std::string& clip) {
  constexpr int kRounds = 9;
  cv::setNumThreads(1);
  const Film film = ReadFilm(clip);
  fmt::print(
      "| tracker | without [ms a frame] | with, over without | the comparison itself [ms] | the "
      "same tracks |\n");
  fmt::print("|---|---|---|---|---|\n");
  for (const TrackerKind kind : {TrackerKind::kKlt, TrackerKind::kSubspace}) {
    TrackerOptions options;
    options.tracker = kind;
    std::vector<double> without;
    std::vector<double> ratios;
    std::vector<double> watch;
    bool same = true;
    for (int round = 0; round < kRounds; ++round) {
      const TrackRun plain = TrackFilm(film, options, false);
      const TrackRun watched = TrackFilm(film, options, true);
      without.push_back(plain.cpu_ms);
      watch.push_back(watched.watch_ms);
      ratios.push_back(watched.cpu_ms / plain.cpu_ms);
      same = same && plain.positions == watched.positions;
    }
    fmt::print("| {} | {:.1f} | {:.3f} | {:.2f} | {} |\n",
               NameOf(kTrackerNames, kind),
               Median(without),
               Median(ratios),
               Median(watch),
               same ? "yes" : "no");
  }
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  CLI::App app{"Which cuts are found, and what is taken for one"};
  std::vector<std::string> tuned;
  std::vector<std::string> other;
  std::string cost;
  std::size_t dark_frames = 100;
  app.add_option("--tuned", tuned, "clips that the thresholds were tuned on");
  app.add_option("--other", other, "clips that they were not");
  app.add_option("--dark-frames", dark_frames, "so many of each clip are degraded")
      ->check(CLI::Range(20, 100000));
  app.add_option("--cost", cost, "the clip to time, instead of the tables");
  CLI11_PARSE(app, argc, argv);
  try {
    if (!cost.empty()) {
      cohort::PrintCost(cost);
      return 0;
    }
    std::vector<std::string> clips = tuned;
    clips.insert(clips.end(), other.begin(), other.end());
    cohort::Run(clips, tuned.size(), dark_frames);
  } catch (const std::exception& error) {
    std::cerr << "cut_benchmark: error: " << error.what() << "\n";
    return 1;
  }
  return 0;
}
