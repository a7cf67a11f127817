// What both passes of tracker `subspace` cost beside OpenCV's KLT with its check.
//   speed_benchmark CLIP [--level medium] [--frames N] [--benchmark_out=speed.json ...]
// The trackers take turns frame by frame, then the second pass and KLT clip by clip, all on the
// same decoded frames in one thread; times are this thread's processor time. Decoding and the
// search for corners, which are the same for all, do not count.  One benchmark a number of features
// F and length L of history (0: no joint guide). Its counters, a frame:
//   first_ms, second_ms, klt_ms    both passes and KLT of 21 x 21 px; klt31_ms: of 31 x 31 px
//   first_klt, second_klt          how many times KLT's time; the median of the frames' ratios, and
//                                  of the whole second pass with all its rounds
//   alive, klt_alive               features
//   first: PART, second: PART      where it goes [ms]
#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <opencv2/core/utility.hpp>
#include <string>
#include <vector>

#include "datasets/degrade/degrade.h"
#include "datasets/open_sequence.h"
#include "frontend/core/part_times.h"
#include "frontend/core/statistics.h"
#include "pipelines/sfm/track_sequence.h"
#include "tests/support/frame_clip.h"

namespace cohort {
namespace {

// The window of every tracker is full.
constexpr std::size_t kFirstTimedFrame = 12;
constexpr std::string_view kCorners = "corners";

// Decoded frames.
class Film final : public test::FrameClip {
 public:
  Film(Sequence& of, const std::optional<DegradeOptions>& degrade) : FrameClip(of.Name()) {
    camera_ = of.KnownCamera();
    while (auto frame = of.Next()) {
      if (degrade) frame->gray = DegradeFrame(frame->gray, *degrade, ToInt(frame->index));
      frames_.push_back(std::move(*frame));
    }
  }
};

using Parts = std::map<std::string, double>;

// Adds the times of what `work` does to `parts`; returns their sum, without the search for corners.
template <typename Work>
double Timed(const Work& work, Parts& parts) {
  const PartTimes times;
  {
    const TimedPart rest("rest");
    work();
  }
  double sum_ms = 0.0;
  for (const auto& [name, ms] : times.ms()) {
    if (name == kCorners) continue;
    parts[std::string(name)] += ms;
    sum_ms += ms;
  }
  return sum_ms;
}

// A tracker as `cohort track` runs it.
class Racer {
 public:
  Racer(Film film, const TrackSequenceOptions& options)
      : film_(std::move(film)), tracker_(film_, options) {
    film_.Rewind();
    film_.Next();
    file_ = tracker_.Header();
  }
  Racer(const Racer&) = delete;
  Racer& operator=(const Racer&) = delete;

  bool HasNext() { return tracker_.HasNext(); }
  void Step() {
    Parts parts;
    TrackedFrame frame;
    const double ms = Timed([&] { frame = tracker_.TrackNext(); }, parts);
    file_.frames.push_back(frame.info);
    const auto& now = frame.result.observations;
    observations_.insert(observations_.end(), now.begin(), now.end());
    ends_.insert(ends_.end(), frame.result.ends.begin(), frame.result.ends.end());
    if (file_.frames.size() <= kFirstTimedFrame) return;
    ms_.push_back(ms);
    alive_ += static_cast<double>(now.size());
    for (const auto& [name, part_ms] : parts) parts_[name] += part_ms;
  }

  TrackFile Finish() {
    file_.tracks = TrackSet::Build(std::move(observations_), std::move(ends_));
    return file_;
  }
  const std::vector<double>& ms() const { return ms_; }
  double alive() const { return alive_ / static_cast<double>(ms_.size()); }
  const Parts& parts() const { return parts_; }

 private:
  Film film_;
  SequenceTracker tracker_;
  TrackFile file_;
  std::vector<Observation> observations_;
  std::vector<TrackEnd> ends_;
  std::vector<double> ms_;
  double alive_ = 0.0;
  Parts parts_;
};

// With a history, the joint guide; with 0, Lucas-Kanade.
TrackSequenceOptions Options(int features, int history_length) {
  TrackSequenceOptions options;
  options.tracker.detector.max_features = features;
  // As many have room in 640 x 480 pixels.
  constexpr double kArea = 640.0 * 480.0;
  auto& distance_px = options.tracker.detector.min_distance_px;
  distance_px = std::min(distance_px, 0.7 * std::sqrt(kArea / features));
  if (history_length > 0) {
    options.tracker.subspace.penalty = PenaltyKind::kEmpiricalDimension;
    options.tracker.subspace.history_length = history_length;
  }
  return options;
}

TrackSequenceOptions Klt(int features, int window_px) {
  TrackSequenceOptions options = Options(features, 0);
  options.tracker.tracker = TrackerKind::kKlt;
  options.tracker.klt.window_px = window_px;
  return options;
}

double MedianRatio(const std::vector<double>& a, const std::vector<double>& b) {
  std::vector<double> ratios;
  for (std::size_t i = 0; i < a.size(); ++i) ratios.push_back(a[i] / b[i]);
  return InterpolatedMedian(ratios);
}

void Race(benchmark::State& state, const Film& film) {
  const auto features = static_cast<int>(state.range(0));
  const auto history_length = static_cast<int>(state.range(1));
  const TrackSequenceOptions ours = Options(features, history_length);
  for ([[maybe_unused]] auto _ : state) {
    enum : std::size_t { kOurs, kKlt21, kKlt31, kRacers };
    std::vector<std::unique_ptr<Racer>> racers;
    for (const auto& options : {ours, Klt(features, 21), Klt(features, 31)}) {
      racers.push_back(std::make_unique<Racer>(film, options));
    }
    for (std::size_t i = 0; racers[0]->HasNext(); ++i) {
      for (std::size_t turn = 0; turn < kRacers; ++turn) racers[(i + turn) % kRacers]->Step();
    }
    const std::vector<double>& klt_ms = racers[kKlt21]->ms();
    const auto timed = static_cast<double>(klt_ms.size());
    auto& counters = state.counters;
    counters["first_ms"] = InterpolatedMedian(racers[kOurs]->ms());
    counters["klt_ms"] = InterpolatedMedian(klt_ms);
    counters["klt31_ms"] = InterpolatedMedian(racers[kKlt31]->ms());
    counters["first_klt"] = MedianRatio(racers[kOurs]->ms(), klt_ms);
    counters["alive"] = racers[kOurs]->alive();
    counters["klt_alive"] = racers[kKlt21]->alive();
    for (const auto& [name, ms] : racers[kOurs]->parts()) counters["first: " + name] = ms / timed;
    state.SetIterationTime(1e-3 * counters["first_ms"]);

    Film copy = film;
    const double frames = static_cast<double>(*film.FrameCount());
    Parts parts;
    const double second_ms =
        Timed([&] { WithSecondPass(racers[kOurs]->Finish(), copy, ours.second_pass); }, parts);
    Racer klt(film, Klt(features, 21));
    while (klt.HasNext()) klt.Step();
    counters["second_ms"] = second_ms / frames;
    counters["second_klt"] = second_ms / frames / InterpolatedMedian(klt.ms());
    for (const auto& [name, ms] : parts) counters["second: " + name] = ms / frames;
  }
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);  // takes its own options out
  CLI::App app("What both passes of tracker subspace cost beside KLT");
  std::string clip;
  std::string level = "medium";
  unsigned frames = 60;
  std::vector<std::int64_t> features{35, 100, 300, 1000, 4000};
  std::vector<std::int64_t> lengths{0};
  app.add_option("clip", clip, "what `cohort track` takes")->required();
  app.add_option("--level", level, "of degradation; as-is: none");
  app.add_option("--frames", frames, "of the clip, at most");
  app.add_option("--features", features, "F")->delimiter(',');
  app.add_option("--lengths", lengths, "L of the joint guide; 0: Lucas-Kanade")->delimiter(',');
  CLI11_PARSE(app, argc, argv);
  try {
    cv::setNumThreads(1);
    const auto sequence =
        cohort::OpenSequence(clip, cohort::Layout::kAuto, cohort::FrameRange{0, frames, 1});
    std::optional<cohort::DegradeOptions> degrade;
    if (level != "as-is") degrade.emplace().level = cohort::ParseLevel(level);
    const cohort::Film film(*sequence, degrade);
    for (const std::int64_t length : lengths) {
      for (const std::int64_t F : features) {
        benchmark::RegisterBenchmark("track",
                                     [&](benchmark::State& state) { cohort::Race(state, film); })
            ->ArgNames({"F", "L"})
            ->Args({F, length})
            ->Iterations(1)
            ->UseManualTime()
            ->Unit(benchmark::kMillisecond);
      }
    }
    benchmark::RunSpecifiedBenchmarks();
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 1;
  }
  return 0;
}
