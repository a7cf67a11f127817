#include "backend/start/initial_pair.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "backend/scene/phrasebook.h"

namespace cohort {
namespace {

// Tuned on the tuning clips, as are the bounds below.
constexpr std::size_t kStarts = 12;
constexpr double kSharedFractions[] = {0.8, 0.6, 0.4};
constexpr double kStandstillPx = 1.0;
constexpr int kMinCommon = 20;          // tracks that both frames have observed
constexpr double kMinAngleDeg = 0.5;    // median triangulation angle, least
constexpr double kGoodAngleDeg = 12.0;  // and beyond which more is no better

// How many observed tracks `frame` shares with each frame after it.
std::vector<std::size_t> CountShared(const TrackSet& tracks, std::size_t start) {
  const auto frames = tracks.frames();
  std::vector<std::size_t> shared(frames.size(), 0);
  for (const Observation* o : tracks.InFrame(frames[start])) {
    if (o->state != ObservationState::kObserved) continue;
    auto i = start;
    for (const Observation& later : tracks.Track(o->feature)) {
      if (later.frame <= frames[start] || later.state != ObservationState::kObserved) continue;
      while (frames[i] < later.frame) ++i;
      ++shared[i];
    }
  }
  return shared;
}

double Score(const TwoViewGeometry& geometry) {
  // Forward motion has its depth where the picture hardly moves; COLMAP refuses it outright.
  const double sideways = geometry.cam2_from_cam1->translation.head<2>().norm();
  // Noise alone has a parallax of 2.5 times the median error (and an angle).
  const double parallax = geometry.parallax_px / (2.5 * std::max(geometry.error_px, 0.05));
  const double evidence = std::clamp((parallax * parallax - 1.0) / 35.0, 0.0, 1.0);
  double score = static_cast<double>(geometry.inlier_count) *
                 std::min(1.0, geometry.angle_deg / kGoodAngleDeg) *
                 (1.0 - 0.5 * std::pow(geometry.homography_ratio, 4)) * std::max(0.2, sideways) *
                 evidence;
  if (geometry.kind == TwoViewKind::kPlanar) score *= 0.5;
  return score;
}

std::string Reason(const InitialPairSearch& search, std::size_t frames) {
  if (!search.ranked.empty()) return DescribeInitialPair(search.ranked.front());
  if (frames < 2) return "no initial pair: fewer than two frames have tracks";
  const InitialPairRefusals& r = search.refusals;
  const std::pair<int, NoPairCause> causes[] = {{r.standstill, NoPairCause::kStandstill},
                                                {r.rotation, NoPairCause::kRotation},
                                                {r.low_angle, NoPairCause::kLowAngle},
                                                {r.degenerate, NoPairCause::kDegenerate},
                                                {r.too_few_common, NoPairCause::kTooFewCommon}};
  const auto* main = std::max_element(
      std::begin(causes), std::end(causes), [](auto& a, auto& b) { return a.first < b.first; });
  return NoInitialPairLine(
      main->second,
      main->first,
      r.standstill + r.rotation + r.low_angle + r.degenerate + r.too_few_common);
}

// Frames after `start` that still share 80, 60 and 40 % of its features, the last such each.
std::set<std::size_t> EndsToTry(const TrackSet& tracks, std::size_t start) {
  const auto frames = tracks.frames();
  const std::vector<std::size_t> shared = CountShared(tracks, start);
  const auto features = static_cast<double>(tracks.CountObserved(frames[start]));
  std::set<std::size_t> ends;
  for (const double fraction : kSharedFractions) {
    const auto enough = std::max(static_cast<double>(kMinCommon), std::ceil(fraction * features));
    for (std::size_t end = frames.size() - 1; end > start; --end) {
      if (static_cast<double>(shared[end]) >= enough) {
        ends.insert(end);
        break;
      }
    }
  }
  return ends;
}

// None, and one refusal more, where the pair is not fit to start from.
std::optional<InitialPair> TryPair(const TrackSet& tracks,
                                   const Camera& camera,
                                   FrameIndex frame1,
                                   FrameIndex frame2,
                                   InitialPairRefusals& refusals) {
  const FramePairMatches matches = MatchFrames(tracks, frame1, frame2);
  InitialPair pair{frame1, frame2, matches.features.size(), {}, 0.0};
  pair.geometry = EstimateTwoViewGeometry(matches.xy1, matches.xy2, camera);
  const TwoViewGeometry& g = pair.geometry;
  if (g.kind == TwoViewKind::kDegenerate) {
    ++refusals.degenerate;
  } else if (g.kind == TwoViewKind::kPanoramic) {
    // A still camera moves its features by noise alone.
    const double still_px = std::max(kStandstillPx, 4.0 * g.error_px);
    ++(g.motion_px < still_px ? refusals.standstill : refusals.rotation);
  } else if (g.angle_deg < kMinAngleDeg) {
    ++refusals.low_angle;
  } else {
    pair.score = Score(g);
    return pair;
  }
  return std::nullopt;
}

}  // namespace

std::string DescribeInitialPair(const InitialPair& pair) {
  return fmt::format(
      "initial pair: frames {} and {}, {}, {} of {} matches, angle {:.1f} deg, homography ratio "
      "{:.2f}, forward {:.2f}",
      ToInt(pair.frame1),
      ToInt(pair.frame2),
      NameOf(kTwoViewKindNames, pair.geometry.kind),
      pair.geometry.inlier_count,
      pair.common,
      pair.geometry.angle_deg,
      pair.geometry.homography_ratio,
      std::abs(pair.geometry.cam2_from_cam1->translation.z()));
}

InitialPairSearch FindInitialPairs(const TrackSet& tracks, const Camera& camera) {
  InitialPairSearch search;
  const auto frames = tracks.frames();
  const std::size_t step = std::max<std::size_t>(1, frames.size() / kStarts);
  for (std::size_t start = 0; start + 1 < frames.size(); start += step) {
    const std::set<std::size_t> ends = EndsToTry(tracks, start);
    if (ends.empty()) ++search.refusals.too_few_common;
    for (const std::size_t end : ends) {
      auto pair = TryPair(tracks, camera, frames[start], frames[end], search.refusals);
      if (pair) search.ranked.push_back(std::move(*pair));
    }
  }
  std::stable_sort(search.ranked.begin(), search.ranked.end(), [](const auto& a, const auto& b) {
    return a.score > b.score;
  });
  search.reason = Reason(search, frames.size());
  return search;
}

}  // namespace cohort
