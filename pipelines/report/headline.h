#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipelines/experiment/results.h"

namespace cohort {

// How many times smaller the cohort's error is: the geometric mean of the ratios of medians over
// seeds, over the clips in which both have one; the least and largest of the same of single seeds,
// of those that failed nowhere. The error of a seed that failed is infinite.
struct HeadlineRatio {
  double value = 0.0;
  double least = 0.0;
  double largest = 0.0;
  std::size_t clips = 0;
};

// Any other tracker of the grid beside the cohort's.
struct OtherTracker {
  std::string name;
  std::optional<HeadlineRatio> camera;  // the other / cohort
  std::optional<HeadlineRatio> points;
  std::optional<HeadlineRatio> length;  // cohort / the other
  std::optional<double> registered;     // by the other
  std::size_t failed = 0;               // its
};

// One level and backend. Of the baselines with several settings (klt21, klt31 ...) the best for
// each clip and figure stands, so that nobody can say they were set badly.
struct HeadlineRow {
  std::string level;
  std::string backend;
  std::size_t clips = 0;
  std::optional<HeadlineRatio> camera_klt;       // ate: best KLT / cohort
  std::optional<HeadlineRatio> camera_anchored;  // best anchored KLT / cohort
  std::optional<HeadlineRatio> camera_refined;   // best KLT with a second pass / cohort
  std::optional<HeadlineRatio> camera_ceiling;   // cohort / ceiling
  std::optional<HeadlineRatio> points_klt;       // median point error
  std::optional<HeadlineRatio> points_anchored;
  std::optional<HeadlineRatio> points_refined;
  std::optional<HeadlineRatio> length_klt;  // mean observed track length, cohort / best KLT
  std::optional<double> registered;         // share of frames with a pose, of all clips and seeds
  std::optional<double> registered_klt;     // the same of the best KLT
  // Clips of which at least half of the seeds failed, so that the median error is infinite.
  std::size_t failed = 0;
  std::size_t failed_klt = 0;
  std::size_t failed_anchored = 0;
  // That are neither a KLT of some kind nor the ceiling, where they ran.
  std::vector<OtherTracker> others;
};

// A clip in which a baseline did better.
struct Loss {
  std::string sequence;
  std::string level;
  std::string backend;
  std::string metric;
  std::string rival;             // the baseline that did best
  std::optional<double> cohort;  // median over seeds; none: failed
  double best = 0.0;             // the rival's
};

struct Headline {
  std::string cohort;  // the tracker that the others are compared with
  std::vector<HeadlineRow> rows;
  std::vector<Loss> losses;
  std::size_t contests = 0;  // cells and figures in which somebody was there to lose to
};

// Compares the tracker `subspace`, or else the first whose name begins so (not `subspace-paper`),
// with the baselines klt, kltN, anchored-klt, anchored-kltN and kltN-refined. None where one of
// either is missing, or no truth gives errors.
std::optional<Headline> MakeHeadline(const ExperimentResults& results);

// Of the trackers FAMILY, FAMILY21, FAMILY31 ... the one with the least median of a figure in a
// cell; none if all failed.
std::optional<std::string> BestTracker(const ExperimentResults& results,
                                       const std::string& sequence,
                                       const std::string& level,
                                       const std::string& backend,
                                       const std::string& metric,
                                       const std::string& family);

// A line for every level and backend, for the terminal and the README:
//   ATE, points  error of the best KLT, or anchored KLT, over the cohort's: above 1 the cohort
//   wins;
//                "of n" where only n clips have both
//   length       mean observed track length, the cohort's over the best KLT's
//   failed       clips that failed: cohort / KLT / anchored KLT
std::string HeadlineTable(const Headline& headline);

// A line for every level, backend and other tracker; empty without.
std::string OthersTable(const Headline& headline);

}  // namespace cohort
