// Frames per second of tracker `subspace` beside KLT 21x21, and where its time goes.
//   speed_benchmark CLIP... [--level medium] [--frames N] [--page FILE]
// All trackers take turns frame by frame in one process and one thread; times are processor time,
// without decoding and without the search for corners (the same for all). Clips are those of
// `cohort synth`; they are degraded here.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <vector>

#include "datasets/degrade/degrade.h"
#include "datasets/open_sequence.h"
#include "frontend/core/output.h"
#include "frontend/core/statistics.h"
#include "frontend/image/frame_offset.h"
#include "frontend/track/track_loop.h"
#include "tests/support/cpu_clock.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

struct Setting {
  int features;
  int history_length;
  double target_fps;
};
constexpr Setting kSettings[] = {{35, 5, 150.0}, {35, 10, 80.0}, {300, 10, 25.0}};
// The window of every tracker is full.
constexpr std::size_t kFirstTimedFrame = 12;

// Adds up the processor time of another mover.
class TimedMover final : public FeatureMover {
 public:
  TimedMover(const TrackerOptions& options, double& ms) : mover_(MakeMover(options)), ms_(ms) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) override {
    const double start_ms = test::CpuMs();
    std::vector<Move> moves = mover_->MoveFeatures(current);
    ms_ += test::CpuMs() - start_ms;
    return moves;
  }
  void Keep(std::span<const std::uint8_t> keep) override {
    const double start_ms = test::CpuMs();
    mover_->Keep(keep);
    ms_ += test::CpuMs() - start_ms;
  }
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override {
    const double start_ms = test::CpuMs();
    mover_->Add(born, current);
    ms_ += test::CpuMs() - start_ms;
  }

 private:
  std::unique_ptr<FeatureMover> mover_;
  double& ms_;
};

// A tracker as `cohort track` runs it.
class Racer {
 public:
  explicit Racer(const TrackerOptions& options)
      : loop_(options, {}, std::make_unique<TimedMover>(options, ms_)) {}
  Racer(const Racer&) = delete;
  Racer& operator=(const Racer&) = delete;

  // Returns the processor time without the pyramid and the search for corners.
  double Step(const Frame& frame) {
    ms_ = 0.0;
    features_ = loop_.Track(frame).observations.size();
    return ms_;
  }

  std::size_t features() const { return features_; }

 private:
  double ms_ = 0.0;
  std::size_t features_ = 0;
  TrackLoop loop_;
};

struct Times {
  std::vector<double> ms;
  std::vector<double> features;

  double MedianMs() const { return InterpolatedMedian(ms); }
  double MeanMs() const { return Mean(ms); }
  double MeanFeatures() const { return Mean(features); }

 private:
  static double Mean(const std::vector<double>& values) {
    double sum = 0.0;
    for (const double value : values) sum += value;
    return sum / static_cast<double>(values.size());
  }
};

enum Racers : std::size_t { kOurs, kGuideOnly, kKlt, kKltUnchecked, kRacers };

struct Results {
  Times racers[kRacers];
  Times pyramid;
  Times registration;
};

std::vector<std::unique_ptr<Racer>> MakeRacers(const Setting& setting) {
  TrackerOptions options;
  options.detector.max_features = setting.features;
  options.subspace.history_length = setting.history_length;
  TrackerOptions guide = options;
  guide.measurement.enabled = false;
  TrackerOptions klt = options;
  klt.tracker = TrackerKind::kKlt;
  TrackerOptions unchecked = klt;
  unchecked.klt.forward_backward_px = 0.0;
  std::vector<std::unique_ptr<Racer>> racers;
  for (const TrackerOptions& o : {options, guide, klt, unchecked}) {
    racers.push_back(std::make_unique<Racer>(o));
  }
  return racers;
}

void Race(const std::vector<Frame>& film, const Setting& setting, Results& results) {
  const auto racers = MakeRacers(setting);
  Pyramid previous;
  for (std::size_t i = 0; i < film.size(); ++i) {
    const bool timed = i >= kFirstTimedFrame;
    const double start_ms = test::CpuMs();
    const Pyramid current = BuildPyramid(film[i].gray);
    const double pyramid_ms = test::CpuMs() - start_ms;
    if (timed) {
      const double built_ms = test::CpuMs();
      RegisterFrames(previous, current);
      results.registration.ms.push_back(test::CpuMs() - built_ms);
      results.pyramid.ms.push_back(pyramid_ms);
    }
    previous = current;
    for (std::size_t turn = 0; turn < kRacers; ++turn) {
      const std::size_t r = (i + turn) % kRacers;
      const double ms = racers[r]->Step(film[i]);
      if (!timed) continue;
      results.racers[r].ms.push_back(pyramid_ms + ms);
      results.racers[r].features.push_back(static_cast<double>(racers[r]->features()));
    }
  }
}

std::string SpeedTable(const std::vector<Results>& all) {
  std::string text =
      "| F, L | alive | median [ms] | fps | target | mean fps | `klt` [ms] | `klt` / ours | "
      "unchecked "
      "[ms] | unchecked / ours |\n"
      "|---|---|---|---|---|---|---|---|---|---|\n";
  for (std::size_t s = 0; s < all.size(); ++s) {
    const Times& ours = all[s].racers[kOurs];
    const double klt_ms = all[s].racers[kKlt].MedianMs();
    const double unchecked_ms = all[s].racers[kKltUnchecked].MedianMs();
    text += fmt::format(
        "| {}, {} | {:.0f} / {:.0f} | {:.2f} | {:.0f} | {:.0f} | {:.0f} | {:.2f} | {:.2f} | {:.2f} "
        "| {:.2f} "
        "|\n",
        kSettings[s].features,
        kSettings[s].history_length,
        ours.MeanFeatures(),
        all[s].racers[kKlt].MeanFeatures(),
        ours.MedianMs(),
        1e3 / ours.MedianMs(),
        kSettings[s].target_fps,
        1e3 / ours.MeanMs(),
        klt_ms,
        klt_ms / ours.MedianMs(),
        unchecked_ms,
        unchecked_ms / ours.MedianMs());
  }
  return text;
}

std::string ShareTable(const std::vector<Results>& all) {
  std::string text =
      "| F, L | pyramid | whole-frame shift | guide | measurement and trajectory model | together "
      "|\n|---|---|---|---|---|---|\n";
  for (std::size_t s = 0; s < all.size(); ++s) {
    const Results& r = all[s];
    const double pyramid = r.pyramid.MedianMs();
    const double shift = r.registration.MedianMs();
    const double guide = r.racers[kGuideOnly].MedianMs();
    const double whole = r.racers[kOurs].MedianMs();
    text += fmt::format("| {}, {} | {:.2f} | {:.2f} | {:.2f} | {:.2f} | {:.2f} |\n",
                        kSettings[s].features,
                        kSettings[s].history_length,
                        pyramid,
                        shift,
                        guide - shift - pyramid,
                        whole - guide,
                        whole);
  }
  return text;
}

std::string Page(const std::vector<std::string>& clips,
                 const std::string& level,
                 const std::vector<Results>& all) {
  std::vector<std::string> names;
  for (const std::string& clip : clips) names.push_back(fs::path(clip).filename().string());
  return fmt::format(
      R"(# Frames per second

Tracker `subspace` beside `klt` (OpenCV's pyramidal Lucas-Kanade, 21 x 21 px, four levels), 640 x 480 px, one thread.
This page is written by

```console
$ speed_benchmark --page docs/results/speed.md \
    WORK/clips/{{{}}}
```

which is built in `build/tests/benchmark`; the clips are those of [paper.md](paper.md), degraded to the level {}.
The trackers take turns frame by frame in one process, so that their ratio holds where the milliseconds do not. Times
are processor time of a frame, from the decoded picture to the features' positions (pyramid included; decoding and the
search for corners, which is common to all, excluded): medians over the frames of all clips from frame {} on. The
mean holds in addition what births cost. F features are asked for; those that end are replaced as `cohort track` does.
Alive are so many with ours / with `klt`; fps are frames per second. `klt` tracks every feature back as a check; the
last columns are without.

{}
Where it goes [ms], medians: the pyramid and the whole-frame shift by themselves; the guide (minimum of the total
energy over four levels, with the blurred pictures for the measurement) from a run without measurement; the rest is the
measurement and the trajectory model.

{})",
      fmt::join(names, ","),
      level,
      kFirstTimedFrame,
      SpeedTable(all),
      ShareTable(all));
}

std::vector<Frame> MakeFilm(const std::string& clip, const std::string& level, unsigned frames) {
  const auto sequence = OpenSequence(clip, Layout::kAuto, FrameRange{0, frames, 1});
  DegradeOptions degrade;
  degrade.level = ParseLevel(level);
  std::vector<Frame> film;
  while (auto frame = sequence->Next()) {
    frame->gray = DegradeFrame(frame->gray, degrade, ToInt(frame->index));
    film.push_back(std::move(*frame));
  }
  if (film.size() <= kFirstTimedFrame) {
    ThrowError("{}: {} frames; give a clip of more than {}", clip, film.size(), kFirstTimedFrame);
  }
  return film;
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  CLI::App app("Frames per second of tracker subspace");
  std::vector<std::string> clips;
  std::string level = "medium";
  unsigned frames = 40;
  std::string page;
  app.add_option("clips", clips, "clips of `cohort synth`")->required();
  app.add_option("--level", level, "of degradation");
  app.add_option("--frames", frames, "of each clip, at most");
  app.add_option("--page", page, "file for the page");
  CLI11_PARSE(app, argc, argv);
  try {
    cv::setNumThreads(1);
    std::vector<cohort::Results> all(std::size(cohort::kSettings));
    for (const std::string& clip : clips) {
      const auto film = cohort::MakeFilm(clip, level, frames);
      for (std::size_t s = 0; s < all.size(); ++s) {
        cohort::Race(film, cohort::kSettings[s], all[s]);
      }
    }
    fmt::print("{}\n{}", cohort::SpeedTable(all), cohort::ShareTable(all));
    if (!page.empty()) {
      cohort::OutputFile file(page);
      cohort::WriteBytes(file.partial(), cohort::Page(clips, level, all));
      file.Commit();
    }
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 1;
  }
  return 0;
}
