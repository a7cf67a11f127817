#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipelines/report/result_index.h"

namespace cohort {

// What a rival is to the cohort.
enum class RivalRole {
  kContender,  // where it does better, the headline says so
  kBound,      // no tracker: what could be reached; its ratios are the cohort's error over its own
  kOther,      // any other tracker of the grid
};

// Whom the cohort is compared with. Of a family (klt: klt, klt21, klt31 ...) the best in each clip
// and figure stands, so that nobody can say that it was set badly.
struct Rival {
  std::string name;    // in tables
  std::string family;  // of trackers; of kOther the tracker itself
  RivalRole role = RivalRole::kOther;

  bool Includes(const std::string& tracker) const;
};

// The rivals that always stand in the headline, where they ran; a new one is one line here. The
// first is the one that the main table is about.
const std::vector<Rival>& StandingRivals();

// How many times better the cohort is: the rival's error over its own, its track length over the
// rival's. The geometric mean over the clips in which both have one, of the ratios of medians over
// seeds; the least and largest of the same of single seeds, of those that failed nowhere. The error
// of a seed that failed is infinite.
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

// What became of the clips at one level and backend. Those of which at least half of the seeds
// failed, of all settings, have an infinite median error, and count as failed.
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
  std::optional<double> cohort;  // median over seeds; none: failed
  double best = 0.0;             // the rival's
};

struct Headline {
  std::string cohort;         // the tracker that the others are compared with
  std::vector<Rival> rivals;  // that ran
  std::vector<HeadlineRow> rows;
  std::vector<HeadlineRuns> runs;
  std::vector<Loss> losses;
  std::size_t contests = 0;  // cells and figures in which somebody was there to lose to

  const HeadlineRatio* Ratio(const std::string& level,
                             const std::string& backend,
                             const std::string& metric,
                             const std::string& rival) const;
  const HeadlineRuns* Runs(const std::string& level,
                           const std::string& backend,
                           const std::string& tracker) const;
};

// Compares the tracker `subspace`, or else the first whose name begins so (not `subspace-paper`),
// with all others. None where it or every contender is missing, or no truth gives errors.
std::optional<Headline> MakeHeadline(const ExperimentResults& results);

// Of a rival's trackers the one with the best median of a figure in a cell (whose tracker is not
// looked at); none if all failed.
std::optional<std::string> BestTracker(const ResultIndex& results,
                                       ResultCell cell,
                                       const std::string& metric,
                                       const Rival& rival);

}  // namespace cohort
