// The paper's Algorithm 1 against joint Newton steps: the energy reached from the same starts, what
// it costs, and where whole runs end.   optimizer_benchmark CLIP... [--levels L,...] [--page FILE]
// The guide alone, as tracker `subspace` runs it: no measurement, no births, no deaths. Clips are
// those of `cohort synth`; they are degraded here. Times are processor time of one thread.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <opencv2/core/utility.hpp>
#include <vector>

#include "datasets/degrade/degrade.h"
#include "datasets/open_sequence.h"
#include "datasets/truth/track_truth.h"
#include "frontend/core/part_times.h"
#include "frontend/core/statistics.h"
#include "frontend/storage/output.h"
#include "frontend/track/subspace/joint_guide.h"
#include "pipelines/experiment/paper_protocol.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

struct Case {
  PenaltyKind penalty;
  Constraint constraint;
  double strength = 1.0;  // m over the calibrated one

  double Weight() const { return strength * CalibratedWeight(penalty, constraint); }
  std::string Name() const {
    return fmt::format(
        "{}, {}", NameOf(kPenaltyNames, penalty), NameOf(kConstraintNames, constraint));
  }
};
const std::vector<Case> kCases{
    {PenaltyKind::kEmpiricalDimension, Constraint::kStrong},
    {PenaltyKind::kNuclearNorm, Constraint::kStrong},
    {PenaltyKind::kExplicitFactorization, Constraint::kStrong},
    {PenaltyKind::kEmpiricalDimension, Constraint::kWeak},
    {PenaltyKind::kNuclearNorm, Constraint::kWeak},
    {PenaltyKind::kExplicitFactorization, Constraint::kWeak},
};
// Of the calibrated m: what fits, and a penalty far too strong, to see what gives way first.
constexpr std::array<double, 2> kStrengths{1.0, 10.0};
constexpr std::array<OptimizerKind, 2> kOptimizers{OptimizerKind::kAlgorithm1,
                                                   OptimizerKind::kJointNewton};
constexpr std::size_t kFrames = 30;
// Energies that differ by less than this share are called equal.
constexpr double kSameEnergy = 1e-3;
// Over so many frames the features' motion relative to each other is compared with the true one.
constexpr std::size_t kFreezeFrames = 10;
constexpr double kFrozenBelow = 0.3;
constexpr double kDriftedAbovePx = 10.0;  // the paper's limit

// A degraded clip and its points.
struct Film {
  std::vector<Pyramid> pictures;
  std::vector<Eigen::Matrix2Xd> truth;  // 2 x F each
};

Film MakeFilm(const fs::path& clip, const std::string& level, unsigned seed) {
  const auto sequence = OpenSequence(clip, Layout::kAuto, FrameRange{0, kFrames + 1, 1});
  const auto true_course = OpenTrackTruth(*sequence, clip);
  Check(true_course != nullptr, "a clip of `cohort synth` has truth");
  PaperProtocolOptions protocol;
  protocol.window_frames = static_cast<int>(kFrames);
  const auto points = ChoosePoints(*sequence, *true_course, {}, protocol);
  if (points.empty()) ThrowError("{}: no point is visible for {} frames", clip.string(), kFrames);
  DegradeOptions degrade;
  degrade.level = ParseLevel(level);
  degrade.seed = seed;
  Film film;
  sequence->Rewind();
  while (const auto frame = sequence->Next()) {
    const std::size_t i = film.pictures.size();
    film.pictures.push_back(
        BuildPyramid(DegradeFrame(frame->gray, degrade, static_cast<std::uint32_t>(frame->index))));
    Eigen::Matrix2Xd truth(2, static_cast<Eigen::Index>(points.size()));
    for (std::size_t f = 0; f < points.size(); ++f) {
      truth.col(static_cast<Eigen::Index>(f)) = points[f].xy[i];
    }
    film.truth.push_back(std::move(truth));
  }
  return film;
}

// Where an optimiser ended in a frame, through all levels of the pyramid.
struct Reached {
  Eigen::Matrix2Xd x;
  double start = 0.0;  // energies at full resolution: at the whole-frame shift,
  double energy = 0.0;
  double truth = 0.0;  // and at the true positions
  int evaluations = 0;
  int steps = 0;
  double ms = 0.0;
};

// The guide of tracker `subspace` with the features of frame 0, once for each optimiser: both have
// the same past.
class Cohort {
 public:
  // No case: every feature for itself.
  Cohort(const Film& film, const Case* with) : film_(film) {
    const Pyramid& first = film.pictures.front();
    SubspaceOptions options;
    if (with != nullptr) {
      options.penalty_weight = with->strength;
      options.penalty = with->penalty;
      options.constraint = with->constraint;
    }
    const auto births = film.truth.front().colwise();
    const std::vector<Eigen::Vector2d> born(births.begin(), births.end());
    confirmed_.assign(born.size(), 1);
    for (const OptimizerKind optimizer : kOptimizers) {
      options.optimizer = optimizer;
      guides_.emplace_back(options);
      guides_.back().Begin(first);
      guides_.back().Add(born, first);
    }
  }

  Reached Move(std::size_t frame, std::size_t optimizer) const {
    const Pyramid& current = film_.pictures[frame];
    const JointGuide& guide = guides_[optimizer];
    const Eigen::Matrix2Xd start = guide.Start(current);
    const double before_ms = ThreadCpuMs();
    const OptimizerResult result = guide.Minimize(current, confirmed_, start);
    Reached reached;
    reached.ms = ThreadCpuMs() - before_ms;
    reached.x = result.x;
    reached.evaluations = result.evaluations;
    reached.steps = result.iterations;
    const LevelEnergy energy = guide.Energy(current, 0, confirmed_);
    reached.start = energy.total().Value(start);
    reached.energy = energy.total().Value(result.x);
    reached.truth = energy.total().Value(film_.truth[frame]);
    return reached;
  }

  // `x` becomes the past.
  void Keep(std::size_t frame, const Eigen::Matrix2Xd& x) {
    for (JointGuide& guide : guides_) guide.Remember(film_.pictures[frame], x, confirmed_);
  }

 private:
  const Film& film_;
  std::vector<std::uint8_t> confirmed_;
  std::vector<JointGuide> guides_;  // by optimiser
};

double MedianError(const Eigen::Matrix2Xd& x, const Eigen::Matrix2Xd& truth) {
  const Eigen::VectorXd errors = (x - truth).colwise().norm();
  return InterpolatedMedian({errors.begin(), errors.end()});
}

// How differently the features move: median distance of their displacements from the mean one.
double Spread(const Eigen::Matrix2Xd& before, const Eigen::Matrix2Xd& now) {
  const Eigen::Matrix2Xd moved = now - before;
  const Eigen::VectorXd own = (moved.colwise() - moved.rowwise().mean()).colwise().norm();
  return InterpolatedMedian({own.begin(), own.end()});
}

// A whole run over a clip.
struct Run {
  double l1_px = 0.0;   // mean over features of the sum over frames
  double spread = 0.0;  // of the last frames' displacements, over the true one
  double end_px = 0.0;  // median error in the last frame

  bool Frozen() const { return spread < kFrozenBelow; }
  bool Drifted() const { return !Frozen() && end_px > kDriftedAbovePx; }
};

// Both optimisers' results in the same frame, from the same history and start.
using Pair = std::array<Reached, 2>;

struct Results {
  std::vector<Pair> pairs;
  std::vector<std::array<double, 2>> errors_px;  // of the pairs
  std::array<std::vector<Run>, 2> runs;          // by optimiser, one a clip
};

// Each optimiser leads once: its positions become the history. The other one is tried as well, in
// every frame, so that neither is judged by the other's past alone.
Run RunCase(const Film& film, const Case* with, std::size_t leader, Results* results) {
  Cohort cohort(film, with);
  std::vector<Eigen::Matrix2Xd> positions{film.truth.front()};
  Run run;
  for (std::size_t i = 1; i <= kFrames; ++i) {
    Pair pair;
    for (std::size_t turn = 0; turn < (results != nullptr ? 2 : 1); ++turn) {
      const std::size_t o = results != nullptr ? (i + turn) % 2 : leader;
      pair[o] = cohort.Move(i, o);
    }
    if (results != nullptr) {
      results->errors_px.push_back(
          {MedianError(pair[0].x, film.truth[i]), MedianError(pair[1].x, film.truth[i])});
      results->pairs.push_back(pair);
    }
    positions.push_back(pair[leader].x);
    cohort.Keep(i, pair[leader].x);
    run.l1_px += (positions.back() - film.truth[i]).cwiseAbs().sum() /
                 static_cast<double>(film.truth[i].cols());
  }
  run.end_px = MedianError(positions[kFrames], film.truth[kFrames]);
  run.spread = Spread(positions[kFrames - kFreezeFrames], positions[kFrames]) /
               Spread(film.truth[kFrames - kFreezeFrames], film.truth[kFrames]);
  return run;
}

template <typename Items, typename Function>
double MedianOf(const Items& items, const Function& value) {
  std::vector<double> values;
  for (const auto& item : items) values.push_back(value(item));
  return InterpolatedMedian(std::move(values));
}

template <typename Items, typename Function>
double ShareOf(const Items& items, const Function& holds) {
  return static_cast<double>(std::count_if(items.begin(), items.end(), holds)) /
         static_cast<double>(items.size());
}

double AboveBetter(const Pair& pair, std::size_t o) {
  return pair[o].energy / std::min(pair[0].energy, pair[1].energy) - 1.0;
}

bool IsLower(const Pair& pair, std::size_t o) {
  return pair[o].energy < (1.0 - kSameEnergy) * pair[1 - o].energy;
}

double TimeRatio(const Results& r) {
  const auto ms = [](std::size_t o) { return [o](const Pair& p) { return p[o].ms; }; };
  return MedianOf(r.pairs, ms(0)) / MedianOf(r.pairs, ms(1));
}

// A figure of both optimisers in a frame: its medians, as a cell.
template <typename Value>
std::string MedianCell(const Results& r, int decimals, const Value& value) {
  const auto median = [&](std::size_t o) {
    return MedianOf(r.pairs, [&](const Pair& p) { return value(p, o); });
  };
  return fmt::format(" {:.{}f} / {:.{}f} |", median(0), decimals, median(1), decimals);
}

// What is reached from the same start.
std::string EnergyRow(const std::string& name, const Results& r) {
  const double truth = MedianOf(r.pairs, [](const Pair& p) { return p[0].truth / p[0].start; });
  const auto lower = [&](std::size_t o) {
    return 100.0 * ShareOf(r.pairs, [&](const Pair& p) { return IsLower(p, o); });
  };
  const auto error_px = [&](std::size_t o) {
    return MedianOf(r.errors_px, [&](const std::array<double, 2>& e) { return e[o]; });
  };
  return fmt::format(
      "| {} |{} {:.3f} |{} {:.0f} / {:.0f} | {:.2f} / {:.2f} |\n",
      name,
      MedianCell(r, 3, [](const Pair& p, std::size_t o) { return p[o].energy / p[o].start; }),
      truth,
      MedianCell(r, 2, [](const Pair& p, std::size_t o) { return 100.0 * AboveBetter(p, o); }),
      lower(0),
      lower(1),
      error_px(0),
      error_px(1));
}

// What it costs.
std::string CostRow(const std::string& name, const Results& r) {
  return fmt::format(
      "| {} |{}{}{} {:.1f} |\n",
      name,
      MedianCell(r, 0, [](const Pair& p, std::size_t o) { return double(p[o].evaluations); }),
      MedianCell(r, 0, [](const Pair& p, std::size_t o) { return double(p[o].steps); }),
      MedianCell(r, 1, [](const Pair& p, std::size_t o) { return p[o].ms; }),
      TimeRatio(r));
}

using LevelResults = std::map<std::string, std::vector<Results>>;  // by level, by case

struct Benchmark {
  std::vector<std::string> clips;
  std::vector<std::string> levels{"clean", "medium", "hard"};
  unsigned seed = 1;
  std::string page;

  std::vector<LevelResults> results;              // by strength
  std::map<std::string, std::vector<Run>> alone;  // by level: no penalty, one a clip
};

void RunAll(Benchmark& b) {
  b.results.resize(kStrengths.size());
  for (const std::string& level : b.levels) {
    for (const std::string& clip : b.clips) {
      const Film film = MakeFilm(clip, level, b.seed);
      fmt::print(stderr, "{}, {}: {} features\n", clip, level, film.truth.front().cols());
      b.alone[level].push_back(RunCase(film, nullptr, 0, nullptr));
      for (std::size_t s = 0; s < kStrengths.size(); ++s) {
        b.results[s][level].resize(kCases.size());
        for (std::size_t c = 0; c < kCases.size(); ++c) {
          Case with = kCases[c];
          with.strength = kStrengths[s];
          Results& results = b.results[s][level][c];
          for (std::size_t o = 0; o < 2; ++o) {
            results.runs[o].push_back(RunCase(film, &with, o, &results));
          }
        }
      }
    }
  }
}

std::string SameStartTables(const Benchmark& b, const LevelResults& results) {
  std::string text;
  for (const std::string& level : b.levels) {
    std::string energies;
    std::string costs;
    for (std::size_t c = 0; c < kCases.size(); ++c) {
      energies += EnergyRow(kCases[c].Name(), results.at(level)[c]);
      costs += CostRow(kCases[c].Name(), results.at(level)[c]);
    }
    text += fmt::format(
        "{}:\n\n| penalty | energy / start | at the truth | above the better [%] | lower in [%] | "
        "error [px] |\n|---|---|---|---|---|---|\n{}\n"
        "| penalty | evaluations | steps | time [ms] | ratio of times "
        "|\n|---|---|---|---|---|\n{}\n",
        level,
        energies,
        costs);
  }
  return text;
}

// L1 error, that of the worst clip, spread, how many froze and drifted.
std::array<std::string, 5> RunCells(const std::vector<Run>& runs) {
  double worst_px = 0.0;
  for (const Run& run : runs) worst_px = std::max(worst_px, run.l1_px);
  const auto count = [&](const auto& holds) {
    return fmt::format("{}", std::count_if(runs.begin(), runs.end(), holds));
  };
  return {fmt::format("{:.1f}", MedianOf(runs, [](const Run& r) { return r.l1_px; })),
          fmt::format("{:.1f}", worst_px),
          fmt::format("{:.2f}", MedianOf(runs, [](const Run& r) { return r.spread; })),
          count([](const Run& r) { return r.Frozen(); }),
          count([](const Run& r) { return r.Drifted(); })};
}

std::string RunTable(const Benchmark& b, const LevelResults& results) {
  std::string text =
      "| level | penalty | L1 error [px] | worst clip | spread / true | frozen | drifted |\n"
      "|---|---|---|---|---|---|---|\n";
  for (const std::string& level : b.levels) {
    text +=
        fmt::format("| {} | none | {} |\n", level, fmt::join(RunCells(b.alone.at(level)), " | "));
    for (std::size_t c = 0; c < kCases.size(); ++c) {
      const auto first = RunCells(results.at(level)[c].runs[0]);
      const auto second = RunCells(results.at(level)[c].runs[1]);
      text += fmt::format("| {} | {} |", level, kCases[c].Name());
      for (std::size_t i = 0; i < first.size(); ++i) {
        text += fmt::format(" {} / {} |", first[i], second[i]);
      }
      text += "\n";
    }
  }
  return text;
}

// How often each optimiser's runs froze or drifted, and where.
struct Failures {
  std::size_t runs = 0;
  std::array<std::size_t, 2> failed{};
  std::array<std::vector<std::string>, 2> where;
};

Failures CountFailures(const Benchmark& b, const LevelResults& results) {
  Failures failures;
  for (const std::string& level : b.levels) {
    for (std::size_t c = 0; c < kCases.size(); ++c) {
      const Results& r = results.at(level)[c];
      failures.runs += r.runs[0].size();
      for (std::size_t o = 0; o < 2; ++o) {
        const auto count = static_cast<std::size_t>(
            std::count_if(r.runs[o].begin(), r.runs[o].end(), [](const Run& run) {
              return run.Frozen() || run.Drifted();
            }));
        failures.failed[o] += count;
        if (count == 0) continue;
        failures.where[o].push_back(fmt::format("{}, {}: {}", level, kCases[c].Name(), count));
      }
    }
  }
  return failures;
}

// One row a level: who reaches the lower energy, and the error.
std::string LevelRow(const std::string& level, const std::vector<Results>& cases) {
  std::vector<Pair> pairs;
  std::vector<double> logs;
  for (const Results& r : cases) {
    pairs.insert(pairs.end(), r.pairs.begin(), r.pairs.end());
    for (std::size_t i = 0; i < r.runs[0].size(); ++i) {
      logs.push_back(std::log(r.runs[0][i].l1_px / r.runs[1][i].l1_px));
    }
  }
  const auto overshoots = [](const Pair& p) {
    return std::max(p[0].energy, p[1].energy) < p[0].truth;
  };
  return fmt::format("| {} | {:.0f} | {:.0f} | {:.0f} | {:.2f} |\n",
                     level,
                     100.0 * ShareOf(pairs, [](const Pair& p) { return IsLower(p, 0); }),
                     100.0 * ShareOf(pairs, [](const Pair& p) { return IsLower(p, 1); }),
                     100.0 * ShareOf(pairs, overshoots),
                     std::exp(InterpolatedMedian(logs)));
}

// What the tables say, from the same numbers.
std::string InShort(const Benchmark& b, const LevelResults& results) {
  std::vector<Pair> all;
  std::vector<double> time_ratios;
  std::string levels;
  for (const std::string& level : b.levels) {
    levels += LevelRow(level, results.at(level));
    for (const Results& r : results.at(level)) {
      all.insert(all.end(), r.pairs.begin(), r.pairs.end());
      time_ratios.push_back(TimeRatio(r));
    }
  }
  const auto [least, largest] = std::minmax_element(time_ratios.begin(), time_ratios.end());
  const auto evaluations = [&](std::size_t o) {
    return MedianOf(all, [o](const Pair& p) { return static_cast<double>(p[o].evaluations); });
  };
  std::string text = fmt::format(
      R"(| level | lower with `algorithm-1` | with `joint-newton` | both below the truth's | L1 error |
|---|---|---|---|---|
{}
The shares of frames in which the energy is lower are in per cent; in the other frames the energies differ by less than
{:.1f} %. The L1 error of a run is that of `algorithm-1` over that of `joint-newton`, median. `joint-newton` evaluates
the energy {:.0f} times per frame, `algorithm-1` {:.0f} times (medians); by penalty and level it is {:.1f} to {:.1f} times as fast.

)",
      levels,
      100.0 * kSameEnergy,
      evaluations(1),
      evaluations(0),
      *least,
      *largest);
  const Failures failures = CountFailures(b, results);
  for (std::size_t o = 0; o < 2; ++o) {
    const auto& where = failures.where[o];
    text += fmt::format("Of {} whole runs with `{}` {} freeze or drift{}.\n",
                        failures.runs,
                        NameOf(kOptimizerNames, kOptimizers[o]),
                        failures.failed[o],
                        where.empty() ? "" : fmt::format(" ({})", fmt::join(where, ";\n")));
  }
  return text;
}

std::string Sections(const Benchmark& b) {
  std::string text;
  for (std::size_t s = 0; s < kStrengths.size(); ++s) {
    const LevelResults& results = b.results[s];
    text += fmt::format("## {:g} m\n\n{}\n", kStrengths[s], InShort(b, results));
    if (kStrengths[s] == 1.0) {
      text += "The same frames, histories and starts, " + SameStartTables(b, results);
    }
    text += fmt::format("Whole runs:\n\n{}\n", RunTable(b, results));
  }
  return text;
}

// Long because it is a page: text, and the numbers in it.
std::string Page(const Benchmark& b) {
  std::vector<std::string> names;
  for (const std::string& clip : b.clips) names.push_back(fs::path(clip).filename().string());
  std::vector<std::string> weights;
  for (const Case& c : kCases) weights.push_back(fmt::format("{} {:g}", c.Name(), c.Weight()));
  const SubspaceOptions options;
  return fmt::format(
      R"(# Two optimisers for one energy

The total energy (eq. 3 of the paper) is minimised by the paper's Algorithm 1 (`--subspace.optimizer algorithm-1`) or
by Newton steps that move all features together (`joint-newton`, the default; see
`frontend/track/subspace/optimizer.h`). This page is written by

```console
$ optimizer_benchmark --page docs/results/optimizers.md \
    WORK/clips/{{{}}}
```

which is built in `build/tests/benchmark`. The clips are those of [paper.md](paper.md).

## Method

The first {} frames of {} clips ({})
are degraded to the levels clean, medium and hard (seed {}). The points are those of the paper's protocol, with
{} x {} px templates of frame 0, L = {}, centred, epsilon {}, four pyramid levels and {} to {} steps per level. The
guide runs alone (no measurement). m of eq. (7) is that of the sensitivity curves
({}),
and ten times that. Ten times is a penalty far too strong, which shows what fails first.

**The same frames, histories and starts.** Each optimiser leads one run over each clip, in which its positions become
the history. In every frame of either run, both optimisers start from the last positions plus the whole-frame shift and
go through all levels of the pyramid. Cells are `algorithm-1` / `joint-newton`, medians over frames:

- *energy / start*: total energy at full resolution at the end, over that at the start; *at the truth*: the same at the
  ground-truth positions,
- *above the better*: how far an energy lies above the lower one of the two; *lower in*: frames in which it is lower by
  more than {:.1f} %,
- *evaluations* of the energy along lines, and *steps* (gradients), over all levels; *time*: processor time of one
  thread, with both optimisers in turn in one process,
- *error*: median distance of the features from the ground truth after that frame, including the error of the history.

**Whole runs.** Each optimiser runs separately over {} frames. Cells are as above; with penalty `none` every feature
moves alone. *L1 error*: mean over features of the sum over the frames of |dx| + |dy|, median over clips.
*Spread / true*: how differently the features moved in the last {} frames (median distance of their displacements from
the mean one), over the true value; noise adds to it. *Frozen*: runs in which it is below {}, so that every feature
repeats the last frame plus the whole-frame shift. *Drifted*: other runs that end with a median error above {:.0f} px.

{})",
      fmt::join(names, ","),
      kFrames,
      names.size(),
      fmt::join(names, ", "),
      b.seed,
      options.template_px,
      options.template_px,
      options.history_length,
      options.epsilon,
      options.min_iterations,
      options.max_iterations,
      fmt::join(weights, ";\n"),
      100.0 * kSameEnergy,
      kFrames,
      kFreezeFrames,
      kFrozenBelow,
      kDriftedAbovePx,
      Sections(b));
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  CLI::App app("Algorithm 1 against joint Newton steps");
  cohort::Benchmark benchmark;
  app.add_option("clips", benchmark.clips, "clips of `cohort synth`")->required();
  app.add_option("--levels", benchmark.levels, "of degradation")->delimiter(',');
  app.add_option("--seed", benchmark.seed, "of the noise");
  app.add_option("--page", benchmark.page, "file for the page");
  CLI11_PARSE(app, argc, argv);
  try {
    cv::setNumThreads(1);
    cohort::RunAll(benchmark);
    fmt::print("{}", cohort::Sections(benchmark));
    if (!benchmark.page.empty()) {
      cohort::OutputFile file(benchmark.page);
      cohort::WriteBytes(file.partial(), cohort::Page(benchmark));
      file.Commit();
    }
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 1;
  }
  return 0;
}
