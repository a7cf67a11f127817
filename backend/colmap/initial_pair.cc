#include "backend/colmap/initial_pair.h"

#include <fmt/format.h>

#include <set>

#include "backend/judge/judgement.h"
#include "backend/scene/keyframes.h"
#include "backend/scene/phrasebook.h"

namespace cohort {

std::string DescribeInitialPair(const InitialPair& pair) {
  return fmt::format("initial pair: frames {} and {}, {} common tracks, angle {:.1f} deg",
                     ToInt(pair.frame1),
                     ToInt(pair.frame2),
                     pair.geometry.inlier_count,
                     pair.geometry.angle_deg);
}

InitialPairs FindInitialPairs(const TrackFile& file, const Camera& camera, int most) {
  constexpr double kMinAngleDeg = 0.5;
  InitialPairs found;
  if (file.frames.size() < 2) {
    found.end = TooFewFramesEnd(file.frames.size(), 2);
    return found;
  }
  const WhitenedTracks whitened(file, {.min_track_length = 2});
  const std::vector<FramePairMotion> pairs =
      RankPairs(whitened, camera, SelectKeyframes(whitened, camera));
  if (pairs.empty()) {
    found.end = NothingSharedEnd(kMinCommonTracks);
    return found;
  }
  std::set<int> begun;
  for (const FramePairMotion& pair : pairs) {
    if (static_cast<int>(found.ranked.size()) == most) break;
    if (!begun.insert(pair.frame_a).second) continue;
    TwoViewGeometry geometry =
        EstimateTwoViewGeometry(whitened, pair.frame_a, pair.frame_b, camera);
    if (!geometry.cam2_from_cam1 || geometry.angle_deg < kMinAngleDeg) continue;
    found.ranked.push_back({whitened.frames()[pair.frame_a].index,
                            whitened.frames()[pair.frame_b].index,
                            std::move(geometry)});
  }
  // Of such a clip, COLMAP would invent a depth.
  if (found.ranked.empty()) {
    found.end = DescribeClipWithoutParallax(
        WidestPairsOf(whitened, pairs), camera, EstimateNoise(whitened));
  }
  return found;
}

}  // namespace cohort
