#include "frontend/tracks/companions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

using Observations = std::vector<const Observation*>;

// Features observed in both of two frames.
struct Links {
  std::vector<FeatureId> first;
  std::vector<FeatureId> companions;
};
Links LinksBetween(const TrackSet& tracks,
                   FeatureId first_companion,
                   FrameIndex frame,
                   FrameIndex next) {
  Links links;
  for (const Observation* o : tracks.InFrame(frame)) {
    const Observation* other = tracks.Find(o->feature, next);
    if (!IsObserved(*o) || other == nullptr || !IsObserved(*other)) continue;
    (o->feature < first_companion ? links.first : links.companions).push_back(o->feature);
  }
  return links;
}

// Both trackers' observed positions in a frame, by ascending x.
struct FrameOfTwo {
  Observations first;
  Observations companions;
};
FrameOfTwo SplitFrame(const CompanionTracks& both, FrameIndex frame) {
  FrameOfTwo split;
  for (const Observation* o : both.tracks.InFrame(frame)) {
    if (!IsObserved(*o)) continue;
    (o->feature < both.first_companion ? split.first : split.companions).push_back(o);
  }
  for (Observations* side : {&split.first, &split.companions}) {
    std::stable_sort(side->begin(), side->end(), [](const auto* a, const auto* b) {
      return a->xy.x() < b->xy.x();
    });
  }
  return split;
}

// The nearest of `sorted` within the distance; null: none is.
const Observation* Nearest(const Observations& sorted,
                           const Eigen::Vector2d& xy,
                           double within_px) {
  const auto begin = std::lower_bound(
      sorted.begin(), sorted.end(), xy.x() - within_px, [](const Observation* o, double x) {
        return o->xy.x() < x;
      });
  const Observation* nearest = nullptr;
  double least = within_px;
  for (auto it = begin; it != sorted.end() && (*it)->xy.x() <= xy.x() + within_px; ++it) {
    const double distance = ((*it)->xy - xy).norm();
    if (distance > least) continue;
    least = distance;
    nearest = *it;
  }
  return nearest;
}

// Of the companion's features that have one: the feature of the first tracker that most of their
// observations lie beside.
std::map<FeatureId, FeatureId> FindTwins(const CompanionTracks& both, double within_px) {
  std::map<FeatureId, std::map<FeatureId, std::size_t>> beside;
  for (const FrameIndex frame : both.tracks.frames()) {
    const FrameOfTwo split = SplitFrame(both, frame);
    for (const Observation* o : split.companions) {
      if (const Observation* near = Nearest(split.first, o->xy, within_px)) {
        ++beside[o->feature][near->feature];
      }
    }
  }
  std::map<FeatureId, FeatureId> twins;
  for (const auto& [companion, counts] : beside) {
    const auto most =
        std::max_element(counts.begin(), counts.end(), [](const auto& a, const auto& b) {
          return a.second < b.second;
        });
    const auto track = both.tracks.Track(companion);
    const auto observed = static_cast<std::size_t>(
        std::count_if(track.begin(), track.end(), [](const auto& o) { return IsObserved(o); }));
    if (2 * most->second > observed) twins[companion] = most->first;
  }
  return twins;
}

// Robust standard deviation of a coordinate of the companion's, from its twins; none of too few.
std::optional<double> SigmaOfCompanions(const CompanionTracks& both,
                                        const std::map<FeatureId, FeatureId>& twins) {
  constexpr std::size_t kEnough = 100;
  std::vector<double> deviations;
  for (const auto& [companion, twin] : twins) {
    std::array<std::vector<double>, 2> differences;
    for (const Observation& o : both.tracks.Track(companion)) {
      const Observation* other = both.tracks.Find(twin, o.frame);
      if (!IsObserved(o) || other == nullptr || !IsObserved(*other)) continue;
      for (int axis = 0; axis < 2; ++axis) {
        differences[static_cast<std::size_t>(axis)].push_back(o.xy[axis] - other->xy[axis]);
      }
    }
    for (const std::vector<double>& values : differences) {
      if (values.size() < 3) continue;
      const double median = Median(values);
      for (const double value : values) deviations.push_back(std::abs(value - median));
    }
  }
  if (deviations.size() < kEnough) return std::nullopt;
  return 1.4826 * Median(std::move(deviations));
}

}  // namespace

std::vector<Stretch> WeakStretches(const TrackSet& tracks, double share, std::size_t reach) {
  const auto& frames = tracks.frames();
  std::vector<double> links;
  std::vector<double> observed;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const auto in_frame = tracks.InFrame(frames[i - 1]);
    observed.push_back(static_cast<double>(std::count_if(
        in_frame.begin(), in_frame.end(), [](const auto* o) { return IsObserved(*o); })));
    links.push_back(static_cast<double>(
        LinksBetween(tracks, kFirstCompanion, frames[i - 1], frames[i]).first.size()));
  }
  const double usual = Median(links);
  std::vector<Stretch> stretches;
  std::size_t behind_last = 0;  // of the last stretch
  double most = 0.0;            // so far: where features are still being found, none are lost
  for (std::size_t i = 0; i < links.size(); ++i) {
    most = std::max(most, links[i]);
    if (links[i] >= share * std::max(std::min(usual, most), observed[i])) continue;
    const std::size_t first = i < reach ? 0 : i - reach;
    const std::size_t last = std::min(i + 1 + reach, frames.size() - 1);
    if (stretches.empty() || first > behind_last) stretches.push_back({frames[first], {}});
    stretches.back().last = frames[last];
    behind_last = last + 1;
  }
  return stretches;
}

TrackSet DropTwins(const CompanionTracks& both, double within_px) {
  const std::map<FeatureId, FeatureId> twins = FindTwins(both, within_px);
  return both.tracks.Select([&](FeatureId feature) { return !twins.contains(feature); });
}

CompanionTracks KeepWhereNeeded(const CompanionTracks& both, double share) {
  const auto& frames = both.tracks.frames();
  std::vector<Links> links;
  std::vector<double> counts;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    links.push_back(LinksBetween(both.tracks, both.first_companion, frames[i - 1], frames[i]));
    counts.push_back(static_cast<double>(links.back().first.size()));
  }
  const double usual = Median(counts);
  std::set<FeatureId> needed;
  for (std::size_t i = 0; i < links.size(); ++i) {
    const std::vector<FeatureId>& companions = links[i].companions;
    if (counts[i] < share * std::max(usual, static_cast<double>(companions.size()))) {
      needed.insert(companions.begin(), companions.end());
    }
  }
  return {both.tracks.Select([&](FeatureId feature) {
            return feature < both.first_companion || needed.contains(feature);
          }),
          both.first_companion};
}

CompanionTracks JoinCompanions(const CompanionTracks& both, double within_px) {
  constexpr double kLeastSigmaPx = 0.3;  // what is taken for noise may be that of the twins alone
  const std::map<FeatureId, FeatureId> twins = FindTwins(both, within_px);
  const std::optional<double> sigma = SigmaOfCompanions(both, twins);
  std::map<FeatureId, FeatureId> names;
  FeatureId next{0};
  for (const FeatureId feature : both.tracks.features()) {
    if (feature < both.first_companion) {
      names[feature] = feature;
      next = FeatureId{ToInt(feature) + 1};
    }
  }
  const FeatureId first_companion = next;
  for (const FeatureId feature : both.tracks.features()) {
    if (feature < both.first_companion || twins.contains(feature)) continue;
    names[feature] = next;
    next = FeatureId{ToInt(next) + 1};
  }
  std::vector<Observation> observations;
  for (Observation o : both.tracks.observations()) {
    const auto name = names.find(o.feature);
    if (name == names.end()) continue;
    o.feature = name->second;
    if (o.feature >= first_companion && sigma) {
      const double variance = std::pow(std::max(*sigma, kLeastSigmaPx), 2);
      o.covariance = PixelCovariance::From(variance * Eigen::Matrix2d::Identity());
    }
    observations.push_back(o);
  }
  std::vector<TrackEnd> ends;
  for (TrackEnd end : both.tracks.ends()) {
    const auto name = names.find(end.feature);
    if (name == names.end()) continue;
    end.feature = name->second;
    ends.push_back(end);
  }
  return {TrackSet::Build(std::move(observations), std::move(ends)), first_companion};
}

}  // namespace cohort
