#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipelines/report/result_index.h"

namespace cohort {

// The role of a rival in the comparison with the cohort.
enum class RivalRole {
  kContender,  // if it does better, the headline reports it
  kBound,      // a bound, not a tracker; its ratios are the cohort's error over its own
  kOther,      // any other tracker of the grid
};

// A tracker that the cohort is compared with. The best of a family (klt: klt, klt21, klt31 ...)
// counts in each clip and figure, which excludes a bad setting as an explanation.
struct Rival {
  std::string name;    // in tables
  std::string family;  // of trackers; of kOther the tracker itself
  RivalRole role = RivalRole::kOther;

  bool Includes(const std::string& tracker) const;
};

// The rivals that always appear in the headline if they ran; a new one is one line here. The main
// table is about the first.
const std::vector<Rival>& StandingRivals();

// By what factor the cohort is better: the rival's error over its own, or its track length over the
// rival's. The value is the geometric mean, over the clips in which both have a figure, of the
// ratios of medians over seeds; least and largest are those of single seeds that failed nowhere. A
// failed seed has an infinite error.
struct HeadlineRatio {
  double value = 0.0;
  double least = 0.0;
  double largest = 0.0;
  std::size_t clips = 0;
};

struct HeadlineRow {
  std::string level;
  std::string backend;
  std::string metric;  // kCameraErrorMetric, kPointErrorMetric or kTrackLengthMetric
  std::string rival;   // its name
  HeadlineRatio ratio;
};

// The outcome of the clips at one level and backend. A clip has an infinite median error and counts
// as failed if at least half of the seeds failed, for all settings.
struct HeadlineRuns {
  std::string level;
  std::string backend;
  std::string tracker;  // the cohort, or a rival's name
  std::size_t clips = 0;
  std::size_t failed = 0;
  double registered = 0.0;  // share of the frames that got a pose, of all clips and seeds
};

// A clip in which a contender did better.
struct Loss {
  std::string sequence;
  std::string level;
  std::string backend;
  std::string metric;
  std::string rival;             // the tracker that did best
  std::optional<double> cohort;  // median over seeds; unset: failed
  double best = 0.0;             // the rival's
};

struct Headline {
  std::string cohort;         // the tracker that the others are compared with
  std::vector<Rival> rivals;  // that ran
  std::vector<HeadlineRow> rows;
  std::vector<HeadlineRuns> runs;
  std::vector<Loss> losses;
  std::size_t contests = 0;  // cells and figures with a contender

  const HeadlineRatio* Ratio(const std::string& level,
                             const std::string& backend,
                             const std::string& metric,
                             const std::string& rival) const;
  const HeadlineRuns* Runs(const std::string& level,
                           const std::string& backend,
                           const std::string& tracker) const;
};

// Compares the tracker `subspace`, or else the first with that prefix (not `subspace-paper`), with
// all others. Returns nullopt if it or every contender is missing, or no ground truth gives errors.
std::optional<Headline> MakeHeadline(const ExperimentResults& results);

// The rival's tracker with the best median of a figure in a cell (whose tracker is ignored);
// nullopt if all failed.
std::optional<std::string> BestTracker(const ResultIndex& results,
                                       ResultCell cell,
                                       const std::string& metric,
                                       const Rival& rival);

}  // namespace cohort
