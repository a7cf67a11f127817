#include "pipelines/report/headline.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "pipelines/experiment/named_trackers.h"

namespace cohort {
namespace {

constexpr const char* kMetrics[] = {kCameraErrorMetric, kPointErrorMetric, kTrackLengthMetric};

std::optional<std::string> FindCohort(const std::vector<std::string>& trackers) {
  std::optional<std::string> first;
  for (const std::string& name : trackers) {
    if (name == "subspace") return name;
    if (!first && name.starts_with("subspace") && name != "subspace-paper") first = name;
  }
  return first;
}

// The standing rivals that are among the trackers, then the other trackers.
std::vector<Rival> FindRivals(const std::vector<std::string>& trackers, const std::string& cohort) {
  std::vector<Rival> rivals;
  for (const Rival& rival : StandingRivals()) {
    const bool ran = std::any_of(trackers.begin(), trackers.end(), [&](const std::string& name) {
      return rival.Includes(name);
    });
    if (ran) rivals.push_back(rival);
  }
  for (const std::string& name : trackers) {
    const auto is_it = [&](const Rival& rival) { return rival.Includes(name); };
    if (name != cohort && std::none_of(rivals.begin(), rivals.end(), is_it)) {
      rivals.push_back({name, name, RivalRole::kOther});
    }
  }
  return rivals;
}

double GeometricMean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += std::log(value);
  return std::exp(sum / static_cast<double>(values.size()));
}

std::optional<HeadlineRatio> Compare(const ResultIndex& results,
                                     const std::string& cohort,
                                     const std::string& level,
                                     const std::string& backend,
                                     const std::string& metric,
                                     const Rival& rival) {
  const bool inverse = (metric == kTrackLengthMetric) != (rival.role == RivalRole::kBound);
  const auto ratio = [inverse](double theirs, double ours) {
    return inverse ? ours / theirs : theirs / ours;
  };
  std::vector<double> ratios;
  std::map<unsigned, std::vector<double>> ratios_of_seed;
  for (const std::string& sequence : results.sequences()) {
    const ResultCell cohort_cell{sequence, level, cohort, backend};
    const auto best = BestTracker(results, cohort_cell, metric, rival);
    if (!best) continue;
    const ResultCell rival_cell{sequence, level, *best, backend};
    const auto theirs = results.Median(rival_cell, metric);
    const auto ours = results.Median(cohort_cell, metric);
    if (!theirs || !ours || !(*theirs > 0.0) || !(*ours > 0.0)) continue;
    ratios.push_back(ratio(*theirs, *ours));
    const auto& of_cohort = results.Values(cohort_cell, metric);
    for (const auto& [seed, value] : results.Values(rival_cell, metric)) {
      const auto it = of_cohort.find(seed);
      if (it == of_cohort.end() || !(value > 0.0) || !(it->second > 0.0)) continue;
      ratios_of_seed[seed].push_back(ratio(value, it->second));
    }
  }
  if (ratios.empty()) return std::nullopt;
  HeadlineRatio result;
  result.value = result.least = result.largest = GeometricMean(ratios);
  result.clips = ratios.size();
  for (const auto& [seed, of_seed] : ratios_of_seed) {
    if (of_seed.size() != ratios.size()) continue;  // a mean over other clips is not comparable
    result.least = std::min(result.least, GeometricMean(of_seed));
    result.largest = std::max(result.largest, GeometricMean(of_seed));
  }
  return result;
}

// The runs of `rival`, with the best of its settings, on the clips that the cohort ran too.
HeadlineRuns CountRuns(const ResultIndex& results,
                       const std::string& cohort,
                       const std::string& level,
                       const std::string& backend,
                       const Rival& rival) {
  HeadlineRuns runs{level, backend, rival.name};
  double registered = 0.0;
  for (const std::string& sequence : results.sequences()) {
    if (!results.Ran({sequence, level, cohort, backend})) continue;
    bool ran = false;
    bool all_failed = true;
    double most = 0.0;
    for (const std::string& tracker : results.trackers()) {
      const ResultCell cell{sequence, level, tracker, backend};
      if (!rival.Includes(tracker) || !results.Ran(cell)) continue;
      ran = true;
      all_failed = all_failed && results.Failed(cell);
      most = std::max(most, *results.RegisteredShare(cell));
    }
    if (!ran) continue;
    ++runs.clips;
    if (all_failed) ++runs.failed;
    registered += most;
  }
  if (runs.clips > 0) runs.registered = registered / static_cast<double>(runs.clips);
  return runs;
}

void AddRows(const ResultIndex& results,
             const std::string& level,
             const std::string& backend,
             Headline& headline) {
  const Rival cohort{headline.cohort, headline.cohort, RivalRole::kOther};
  const HeadlineRuns own = CountRuns(results, cohort.name, level, backend, cohort);
  if (own.clips == 0) return;
  headline.runs.push_back(own);
  for (const Rival& rival : headline.rivals) {
    const HeadlineRuns runs = CountRuns(results, cohort.name, level, backend, rival);
    if (runs.clips == 0) continue;
    headline.runs.push_back(runs);
    for (const char* metric : kMetrics) {
      const auto ratio = Compare(results, cohort.name, level, backend, metric, rival);
      if (ratio) headline.rows.push_back({level, backend, metric, rival.name, *ratio});
    }
  }
}

// The best tracker among the contenders in a cell, and its figure.
std::optional<std::pair<std::string, double>> BestContender(const ResultIndex& results,
                                                            const ResultCell& cell,
                                                            const std::string& metric,
                                                            const std::vector<Rival>& rivals) {
  std::optional<std::pair<std::string, double>> best;
  for (const Rival& rival : rivals) {
    if (rival.role != RivalRole::kContender) continue;
    const auto tracker = BestTracker(results, cell, metric, rival);
    if (!tracker) continue;
    const double value =
        *results.Median({cell.sequence, cell.level, *tracker, cell.backend}, metric);
    if (!best || value < best->second) best = {*tracker, value};
  }
  return best;
}

void AddLosses(const ResultIndex& results, Headline& headline) {
  for (const std::string& level : results.levels()) {
    for (const std::string& backend : results.backends()) {
      for (const std::string& sequence : results.sequences()) {
        for (const char* metric : {kCameraErrorMetric, kPointErrorMetric}) {
          const ResultCell cell{sequence, level, headline.cohort, backend};
          const auto best = BestContender(results, cell, metric, headline.rivals);
          if (!best || !results.Ran(cell)) continue;
          ++headline.contests;
          const auto ours = results.Median(cell, metric);
          if (ours && *ours <= best->second) continue;
          headline.losses.push_back(
              {sequence, level, backend, metric, best->first, ours, best->second});
        }
      }
    }
  }
}

}  // namespace

const std::vector<Rival>& StandingRivals() {
  static const std::vector<Rival> kRivals{
      {"KLT", "klt", RivalRole::kContender},
      {"anchored KLT", "anchored-klt", RivalRole::kContender},
      {"KLT refined", "klt-refined", RivalRole::kContender},
      {"ceiling", "ceiling", RivalRole::kBound},
  };
  return kRivals;
}

bool Rival::Includes(const std::string& tracker) const {
  return role == RivalRole::kOther ? tracker == family : IsOfFamily(tracker, family);
}

const HeadlineRatio* Headline::Ratio(const std::string& level,
                                     const std::string& backend,
                                     const std::string& metric,
                                     const std::string& rival) const {
  for (const HeadlineRow& row : rows) {
    if (row.level == level && row.backend == backend && row.metric == metric &&
        row.rival == rival) {
      return &row.ratio;
    }
  }
  return nullptr;
}

const HeadlineRuns* Headline::Runs(const std::string& level,
                                   const std::string& backend,
                                   const std::string& tracker) const {
  for (const HeadlineRuns& of_tracker : runs) {
    if (of_tracker.level == level && of_tracker.backend == backend &&
        of_tracker.tracker == tracker) {
      return &of_tracker;
    }
  }
  return nullptr;
}

std::optional<Headline> MakeHeadline(const ExperimentResults& results) {
  const ResultIndex index(results);
  const auto cohort = FindCohort(index.trackers());
  if (!cohort) return std::nullopt;
  Headline headline;
  headline.cohort = *cohort;
  headline.rivals = FindRivals(index.trackers(), *cohort);
  for (const std::string& level : index.levels()) {
    for (const std::string& backend : index.backends()) {
      AddRows(index, level, backend, headline);
    }
  }
  AddLosses(index, headline);
  const auto is_contender = [&](const std::string& name) {
    return std::any_of(headline.rivals.begin(), headline.rivals.end(), [&](const Rival& rival) {
      return rival.name == name && rival.role == RivalRole::kContender;
    });
  };
  const bool has_errors =
      std::any_of(headline.rows.begin(), headline.rows.end(), [&](const HeadlineRow& row) {
        return row.metric != kTrackLengthMetric && is_contender(row.rival);
      });
  if (!has_errors && headline.losses.empty()) return std::nullopt;
  return headline;
}

std::optional<std::string> BestTracker(const ResultIndex& results,
                                       ResultCell cell,
                                       const std::string& metric,
                                       const Rival& rival) {
  std::optional<std::string> best;
  double best_value = 0.0;
  for (const std::string& tracker : results.trackers()) {
    if (!rival.Includes(tracker)) continue;
    cell.tracker = tracker;
    const auto value = results.Median(cell, metric);
    if (!value) continue;
    const bool better = metric == kTrackLengthMetric ? *value > best_value : *value < best_value;
    if (!best || better) {
      best = tracker;
      best_value = *value;
    }
  }
  return best;
}

}  // namespace cohort
