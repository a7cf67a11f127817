#include "backend/scene/keyframes.h"

#include <algorithm>
#include <cmath>

#include "backend/geometry/best_rotation.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

std::vector<int> SelectOnce(const WhitenedTracks& whitened,
                            const Camera& camera,
                            double parallax_px) {
  constexpr double kMinKept = 0.7;
  constexpr std::size_t kMinTracks = 4;
  std::vector<int> keyframes;
  int last_usable = -1;
  for (int f = 0; f < whitened.frame_count(); ++f) {
    const std::size_t tracks = whitened.ObservationsIn(f).size();
    if (tracks < kMinTracks) continue;
    last_usable = f;
    if (keyframes.empty()) {
      keyframes.push_back(f);
      continue;
    }
    const int last = keyframes.back();
    const FramePairMotion motion = MeasureMotion(whitened, camera, last, f);
    if (motion.parallax_px < parallax_px &&
        motion.common >= kMinKept * static_cast<double>(whitened.ObservationsIn(last).size())) {
      continue;
    }
    // If many tracks end suddenly, the frame before still has them.
    constexpr double kBreak = 0.5;
    if (f - 1 > last &&
        motion.common < kBreak * static_cast<double>(whitened.ObservationsIn(last).size()) &&
        whitened.ObservationsIn(f - 1).size() >= kMinTracks) {
      keyframes.push_back(f - 1);
    }
    keyframes.push_back(f);
  }
  // If nothing moves, this gives a pair of frames that shows it.
  if (keyframes.size() == 1 && last_usable > keyframes.front()) keyframes.push_back(last_usable);
  return keyframes;
}

}  // namespace

FramePairMotion MeasureMotion(const WhitenedTracks& whitened,
                              const Camera& camera,
                              int frame_a,
                              int frame_b) {
  FramePairMotion motion{frame_a, frame_b};
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> pairs;
  std::vector<double> displacements;
  for (const auto& [a, b] : whitened.CommonObservations(frame_a, frame_b)) {
    const Eigen::Vector2d& xy_a = whitened.observations()[a].xy;
    const Eigen::Vector2d& xy_b = whitened.observations()[b].xy;
    pairs.emplace_back(camera.Unproject(xy_a), camera.Unproject(xy_b));
    displacements.push_back((xy_b - xy_a).norm());
  }
  motion.common = static_cast<int>(pairs.size());
  motion.motion_px = Median(std::move(displacements));
  motion.parallax_px = Median(FitRotation(pairs).errors) * 0.5 * (camera.fx + camera.fy);
  return motion;
}

std::vector<int> SelectKeyframes(const WhitenedTracks& whitened,
                                 const Camera& camera,
                                 double parallax_px,
                                 int at_least) {
  std::vector<int> keyframes = SelectOnce(whitened, camera, parallax_px);
  while (static_cast<int>(keyframes.size()) < at_least && parallax_px > 1.0) {
    parallax_px = std::max(1.0, parallax_px / 2.0);
    keyframes = SelectOnce(whitened, camera, parallax_px);
  }
  return keyframes;
}

std::vector<FramePairMotion> RankPairs(const WhitenedTracks& whitened,
                                       const Camera& camera,
                                       const std::vector<int>& keyframes) {
  constexpr double kMinShared = 0.3;
  constexpr double kGoodParallax = 0.06;  // normalised units: 30 px at f = 500 px
  const double good_px = kGoodParallax * 0.5 * (camera.fx + camera.fy);
  // Spread over the clip, so that the time does not grow with the square of its length.
  const int count = static_cast<int>(keyframes.size());
  const int first_step = std::max(1, count / 40);
  std::vector<FramePairMotion> pairs;
  for (int i = 0; i < count; i += first_step) {
    int step = 1;
    for (int j = i + 1; j < count; j += step) {
      const FramePairMotion motion = MeasureMotion(whitened, camera, keyframes[i], keyframes[j]);
      const auto tracks =
          static_cast<double>(std::min(whitened.ObservationsIn(keyframes[i]).size(),
                                       whitened.ObservationsIn(keyframes[j]).size()));
      if (motion.common < kMinCommonTracks || motion.common < kMinShared * tracks) break;
      pairs.push_back(motion);
      if (j - i >= 4 * step) step *= 2;
    }
  }
  const auto score = [good_px](const FramePairMotion& m) {
    return m.common * std::min(1.0, m.parallax_px / good_px);
  };
  std::stable_sort(pairs.begin(), pairs.end(), [&](const auto& a, const auto& b) {
    return score(a) > score(b);
  });
  return pairs;
}

}  // namespace cohort
