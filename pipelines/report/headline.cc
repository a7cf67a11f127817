#include "pipelines/report/headline.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <string_view>
#include <tuple>

#include "frontend/core/statistics.h"
#include "pipelines/console/table.h"

namespace cohort {
namespace {

constexpr const char* kCamera = "ate";
constexpr const char* kPoints = "point_error_median";
constexpr const char* kLength = "mean_track_length";
const std::string kKlt = "klt";
const std::string kAnchored = "anchored-klt";
const std::string kKltRefined = "klt-refined";
const std::string kCeiling = "ceiling";

// Values by seed of (sequence, level, tracker, backend, metric).
using Key = std::tuple<std::string, std::string, std::string, std::string, std::string>;

class Values {
 public:
  explicit Values(const ExperimentResults& results) {
    for (const ResultRow& row : results.rows) {
      values_[{row.sequence, row.level, row.tracker, row.backend, row.metric}][row.seed] =
          row.value;
      AddOnce(row.sequence, sequences_);
      AddOnce(row.level, levels_);
      AddOnce(row.tracker, trackers_);
      if (!row.backend.empty()) AddOnce(row.backend, backends_);
    }
  }

  const std::vector<std::string>& sequences() const { return sequences_; }
  const std::vector<std::string>& levels() const { return levels_; }
  const std::vector<std::string>& trackers() const { return trackers_; }
  const std::vector<std::string>& backends() const { return backends_; }

  const std::map<unsigned, double>& Of(const Key& key) const {
    static const std::map<unsigned, double> kNone;
    const auto it = values_.find(key);
    return it == values_.end() ? kNone : it->second;
  }

  // So many seeds failed, by themselves or because tracking did, that the median error is infinite.
  bool Failed(const std::string& sequence,
              const std::string& level,
              const std::string& tracker,
              const std::string& backend) const {
    const auto& failed = Of({sequence, level, tracker, backend, "failed"});
    const auto failures = std::count_if(
        failed.begin(), failed.end(), [](const auto& seed) { return seed.second != 0.0; });
    return failures > 0 && 2 * failures >= static_cast<std::ptrdiff_t>(failed.size());
  }
  bool Ran(const std::string& sequence,
           const std::string& level,
           const std::string& tracker,
           const std::string& backend) const {
    return !Of({sequence, level, tracker, backend, "failed"}).empty();
  }

  // The error of a seed that failed is infinite; else it would be those who fail where it is hard
  // that have the small medians.
  std::optional<double> Median(const Key& key) const {
    const auto& [sequence, level, tracker, backend, metric] = key;
    if (Failed(sequence, level, tracker, backend)) return std::nullopt;
    std::vector<double> values;
    for (const auto& [seed, value] : Of(key)) values.push_back(value);
    if (values.empty()) return std::nullopt;
    if (metric != kLength) {
      for (const auto& [seed, failed] : Of({sequence, level, tracker, backend, "failed"})) {
        if (failed != 0.0) values.push_back(std::numeric_limits<double>::infinity());
      }
    }
    return InterpolatedMedian(std::move(values));
  }

 private:
  static void AddOnce(const std::string& name, std::vector<std::string>& names) {
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }

  std::map<Key, std::map<unsigned, double>> values_;
  std::vector<std::string> sequences_, levels_, trackers_, backends_;  // in order of appearance
};

// klt21 is of the family klt, klt21-refined of klt-refined.
bool IsOf(std::string_view tracker, std::string_view family) {
  constexpr std::string_view kRefined = "-refined";
  if (tracker.ends_with(kRefined) != family.ends_with(kRefined)) return false;
  if (family.ends_with(kRefined)) {
    tracker.remove_suffix(kRefined.size());
    family.remove_suffix(kRefined.size());
  }
  return tracker.starts_with(family) &&
         tracker.find_first_not_of("0123456789", family.size()) == std::string_view::npos;
}

// The length of tracks is the tracker's, whatever the backend.
Key KeyOf(const std::string& sequence,
          const std::string& level,
          const std::string& tracker,
          const std::string& backend,
          const std::string& metric) {
  return {sequence, level, tracker, metric == kLength ? "" : backend, metric};
}

// Which trackers stand for one rival: the best of them counts.
using IsRival = std::function<bool(const std::string& tracker)>;
IsRival Family(const std::string& family) {
  return [family](const std::string& tracker) { return IsOf(tracker, family); };
}
IsRival Only(const std::string& name) {
  return [name](const std::string& tracker) { return tracker == name; };
}

std::optional<std::string> Best(const Values& values,
                                const std::string& sequence,
                                const std::string& level,
                                const std::string& backend,
                                const std::string& metric,
                                const IsRival& is_rival) {
  std::optional<std::string> best;
  double best_value = 0.0;
  for (const std::string& tracker : values.trackers()) {
    if (!is_rival(tracker) || values.Failed(sequence, level, tracker, backend)) continue;
    const auto value = values.Median(KeyOf(sequence, level, tracker, backend, metric));
    if (!value) continue;
    const bool better = metric == kLength ? *value > best_value : *value < best_value;
    if (!best || better) {
      best = tracker;
      best_value = *value;
    }
  }
  return best;
}

std::optional<std::string> Cohort(const Values& values) {
  std::optional<std::string> first;
  for (const std::string& name : values.trackers()) {
    if (name == "subspace") return name;
    if (!first && name.starts_with("subspace") && name != "subspace-paper") first = name;
  }
  return first;
}

double GeometricMean(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += std::log(value);
  return std::exp(sum / static_cast<double>(values.size()));
}

// Over the clips, rival / cohort or, with `rival_on_top` false, cohort / rival.
std::optional<HeadlineRatio> Ratio(const Values& values,
                                   const std::string& cohort,
                                   const std::string& level,
                                   const std::string& backend,
                                   const std::string& metric,
                                   const IsRival& is_rival,
                                   bool rival_on_top) {
  std::vector<double> ratios;
  std::map<unsigned, std::vector<double>> ratios_of_seed;
  for (const std::string& sequence : values.sequences()) {
    const auto rival = Best(values, sequence, level, backend, metric, is_rival);
    if (!rival || values.Failed(sequence, level, cohort, backend)) continue;
    const Key rival_key = KeyOf(sequence, level, *rival, backend, metric);
    const Key cohort_key = KeyOf(sequence, level, cohort, backend, metric);
    const auto theirs = values.Median(rival_key);
    const auto ours = values.Median(cohort_key);
    if (!theirs || !ours || !(*theirs > 0.0) || !(*ours > 0.0)) continue;
    const auto ratio = [rival_on_top](double t, double o) { return rival_on_top ? t / o : o / t; };
    ratios.push_back(ratio(*theirs, *ours));
    for (const auto& [seed, value] : values.Of(rival_key)) {
      const auto& of_cohort = values.Of(cohort_key);
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
    if (of_seed.size() != ratios.size()) continue;  // other clips, another mean
    result.least = std::min(result.least, GeometricMean(of_seed));
    result.largest = std::max(result.largest, GeometricMean(of_seed));
  }
  return result;
}

// Of all clips and seeds; a failed one counts with what it registered.
std::optional<double> RegisteredShare(const Values& values,
                                      const std::string& tracker,
                                      const std::string& level,
                                      const std::string& backend,
                                      const std::string& sequence) {
  const auto& registered = values.Of({sequence, level, tracker, backend, "registered"});
  const auto& frames = values.Of({sequence, level, tracker, backend, "frames"});
  const auto& runs = values.Of({sequence, level, tracker, backend, "failed"});
  if (runs.empty()) return std::nullopt;
  double sum = 0.0;
  for (const auto& [seed, count] : registered) {
    const auto it = frames.find(seed);
    if (it != frames.end() && it->second > 0.0) sum += count / it->second;
  }
  return sum / static_cast<double>(runs.size());
}

void AddOther(const Values& values,
              const std::string& cohort,
              const std::string& name,
              HeadlineRow& row) {
  const auto ratio = [&](const char* metric, bool other_on_top) {
    return Ratio(values, cohort, row.level, row.backend, metric, Only(name), other_on_top);
  };
  OtherTracker other;
  other.name = name;
  other.camera = ratio(kCamera, true);
  other.points = ratio(kPoints, true);
  other.length = ratio(kLength, false);
  double registered = 0.0;
  std::size_t clips = 0;
  for (const std::string& sequence : values.sequences()) {
    const auto share = RegisteredShare(values, name, row.level, row.backend, sequence);
    if (!share) continue;
    ++clips;
    registered += *share;
    if (values.Failed(sequence, row.level, name, row.backend)) ++other.failed;
  }
  if (clips == 0) return;
  other.registered = registered / static_cast<double>(clips);
  row.others.push_back(std::move(other));
}

HeadlineRow RowOf(const Values& values,
                  const std::string& cohort,
                  const std::string& level,
                  const std::string& backend) {
  HeadlineRow row;
  row.level = level;
  row.backend = backend;
  const auto ratio = [&](const char* metric, const std::string& family, bool rival_on_top) {
    return Ratio(values, cohort, level, backend, metric, Family(family), rival_on_top);
  };
  row.camera_klt = ratio(kCamera, kKlt, true);
  row.camera_anchored = ratio(kCamera, kAnchored, true);
  row.camera_refined = ratio(kCamera, kKltRefined, true);
  row.camera_ceiling = ratio(kCamera, kCeiling, false);
  row.points_klt = ratio(kPoints, kKlt, true);
  row.points_anchored = ratio(kPoints, kAnchored, true);
  row.points_refined = ratio(kPoints, kKltRefined, true);
  row.length_klt = ratio(kLength, kKlt, false);
  std::vector<double> ours;
  std::vector<double> theirs;
  for (const std::string& sequence : values.sequences()) {
    if (!values.Ran(sequence, level, cohort, backend)) continue;
    ++row.clips;
    if (values.Failed(sequence, level, cohort, backend)) ++row.failed;
    ours.push_back(*RegisteredShare(values, cohort, level, backend, sequence));
    for (const auto& [family, failed] :
         {std::pair{&kKlt, &row.failed_klt}, std::pair{&kAnchored, &row.failed_anchored}}) {
      bool ran = false;
      bool all_failed = true;
      double most = 0.0;
      for (const std::string& tracker : values.trackers()) {
        if (!IsOf(tracker, *family) || !values.Ran(sequence, level, tracker, backend)) continue;
        ran = true;
        all_failed = all_failed && values.Failed(sequence, level, tracker, backend);
        most = std::max(most, *RegisteredShare(values, tracker, level, backend, sequence));
      }
      if (ran && all_failed) ++*failed;
      if (ran && family == &kKlt) theirs.push_back(most);
    }
  }
  const auto is_shown = [&](const std::string& name) {
    return name == cohort || IsOf(name, kKlt) || IsOf(name, kAnchored) || IsOf(name, kKltRefined) ||
           name == kCeiling;
  };
  for (const std::string& name : values.trackers()) {
    if (!is_shown(name)) AddOther(values, cohort, name, row);
  }
  const auto mean = [](const std::vector<double>& shares) -> std::optional<double> {
    if (shares.empty()) return std::nullopt;
    double sum = 0.0;
    for (const double share : shares) sum += share;
    return sum / static_cast<double>(shares.size());
  };
  row.registered = mean(ours);
  row.registered_klt = mean(theirs);
  return row;
}

void AddLosses(const Values& values, const std::string& cohort, Headline& headline) {
  for (const std::string& level : values.levels()) {
    for (const std::string& backend : values.backends()) {
      for (const std::string& sequence : values.sequences()) {
        for (const char* metric : {kCamera, kPoints}) {
          std::optional<std::string> rival;
          double best = 0.0;
          for (const std::string& family : {kKlt, kAnchored, kKltRefined}) {
            const auto tracker = Best(values, sequence, level, backend, metric, Family(family));
            if (!tracker) continue;
            const double value = *values.Median({sequence, level, *tracker, backend, metric});
            if (rival && value >= best) continue;
            rival = tracker;
            best = value;
          }
          if (!rival || !values.Ran(sequence, level, cohort, backend)) continue;
          ++headline.contests;
          const auto ours = values.Median({sequence, level, cohort, backend, metric});
          if (ours && *ours <= best) continue;
          headline.losses.push_back({sequence, level, backend, metric, *rival, ours, best});
        }
      }
    }
  }
}

std::string RatioText(const std::optional<HeadlineRatio>& ratio, std::size_t clips) {
  if (!ratio) return "-";
  std::string text = fmt::format("{:.2f}", ratio->value);
  if (ratio->least != ratio->largest) {
    text += fmt::format(" ({:.2f}..{:.2f})", ratio->least, ratio->largest);
  }
  if (ratio->clips < clips) text += fmt::format(" of {}", ratio->clips);
  return text;
}

std::string Percent(const std::optional<double>& share) {
  return share ? fmt::format("{:.0f} %", 100.0 * *share) : "-";
}

}  // namespace

std::optional<Headline> MakeHeadline(const ExperimentResults& results) {
  const Values values(results);
  const auto cohort = Cohort(values);
  const auto& names = values.trackers();
  const bool has_rival = std::any_of(names.begin(), names.end(), [](const std::string& name) {
    return IsOf(name, kKlt) || IsOf(name, kAnchored);
  });
  if (!cohort || !has_rival) return std::nullopt;
  Headline headline;
  headline.cohort = *cohort;
  for (const std::string& level : values.levels()) {
    for (const std::string& backend : values.backends()) {
      HeadlineRow row = RowOf(values, *cohort, level, backend);
      if (row.clips > 0) headline.rows.push_back(std::move(row));
    }
  }
  AddLosses(values, *cohort, headline);
  const bool has_errors =
      std::any_of(headline.rows.begin(), headline.rows.end(), [](const HeadlineRow& row) {
        return row.camera_klt || row.camera_anchored || row.points_klt || row.points_anchored;
      });
  if (!has_errors && headline.losses.empty()) return std::nullopt;
  return headline;
}

std::optional<std::string> BestTracker(const ExperimentResults& results,
                                       const std::string& sequence,
                                       const std::string& level,
                                       const std::string& backend,
                                       const std::string& metric,
                                       const std::string& family) {
  return Best(Values(results), sequence, level, backend, metric, Family(family));
}

std::string HeadlineTable(const Headline& headline) {
  const std::string& name = headline.cohort;
  std::vector<std::vector<std::string>> table{{"level",
                                               "backend",
                                               "clips",
                                               "ATE: KLT/" + name,
                                               "anchored/" + name,
                                               "KLT refined/" + name,
                                               name + "/ceiling",
                                               "points: KLT/" + name,
                                               "anchored/" + name,
                                               "KLT refined/" + name,
                                               "length: " + name + "/KLT",
                                               "registered: " + name,
                                               "KLT",
                                               "failed"}};
  for (const HeadlineRow& row : headline.rows) {
    table.push_back({row.level,
                     row.backend,
                     fmt::format("{}", row.clips),
                     RatioText(row.camera_klt, row.clips),
                     RatioText(row.camera_anchored, row.clips),
                     RatioText(row.camera_refined, row.clips),
                     RatioText(row.camera_ceiling, row.clips),
                     RatioText(row.points_klt, row.clips),
                     RatioText(row.points_anchored, row.clips),
                     RatioText(row.points_refined, row.clips),
                     RatioText(row.length_klt, row.clips),
                     Percent(row.registered),
                     Percent(row.registered_klt),
                     fmt::format("{}/{}/{}", row.failed, row.failed_klt, row.failed_anchored)});
  }
  return AlignedTable(WithoutEmptyColumns(table), 2);
}

std::string OthersTable(const Headline& headline) {
  const std::string& name = headline.cohort;
  std::vector<std::vector<std::string>> table{{"level",
                                               "backend",
                                               "tracker",
                                               "ATE: it/" + name,
                                               "points: it/" + name,
                                               "length: " + name + "/it",
                                               "registered: it",
                                               "failed: it"}};
  for (const HeadlineRow& row : headline.rows) {
    for (const OtherTracker& other : row.others) {
      table.push_back({row.level,
                       row.backend,
                       other.name,
                       RatioText(other.camera, row.clips),
                       RatioText(other.points, row.clips),
                       RatioText(other.length, row.clips),
                       Percent(other.registered),
                       fmt::format("{} of {}", other.failed, row.clips)});
    }
  }
  if (table.size() == 1) return "";
  return AlignedTable(WithoutEmptyColumns(table), 3);
}

}  // namespace cohort
