#include "backend/scene/keyframes.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "backend/geometry/best_rotation.h"
#include "backend/scene/two_view_geometry.h"
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
    // Where the tracks break off suddenly, the frame before still has them.
    constexpr double kBreak = 0.5;
    if (f - 1 > last &&
        motion.common < kBreak * static_cast<double>(whitened.ObservationsIn(last).size()) &&
        whitened.ObservationsIn(f - 1).size() >= kMinTracks) {
      keyframes.push_back(f - 1);
    }
    keyframes.push_back(f);
  }
  // Where nothing moves, a pair of frames that shows it.
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
  motion.parallax_px = FitRotation(pairs).median_error * 0.5 * (camera.fx + camera.fy);
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
                                       const std::vector<int>& keyframes,
                                       int min_common) {
  constexpr double kMinShared = 0.3;
  constexpr double kGoodParallax = 0.06;  // normalised units: 30 px at f = 500 px
  const double good_px = kGoodParallax * 0.5 * (camera.fx + camera.fy);
  // Spread over the clip, so that the cost does not grow with the square of its length.
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
      if (motion.common < min_common || motion.common < kMinShared * tracks) break;
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

double EstimateNoise(const WhitenedTracks& whitened) {
  const auto& observations = whitened.observations();
  std::vector<std::vector<Eigen::Vector2d>> differences(whitened.frame_count());
  for (std::size_t i = 2; i < observations.size(); ++i) {
    const WhitenedObservation& a = observations[i - 2];
    const WhitenedObservation& b = observations[i - 1];
    const WhitenedObservation& c = observations[i];
    if (a.track != c.track || c.frame != a.frame + 2) continue;
    differences[b.frame].push_back(a.xy - 2.0 * b.xy + c.xy);
  }
  std::vector<double> deviations;
  for (const auto& in_frame : differences) {
    for (int axis = 0; axis < 2; ++axis) {
      std::vector<double> values;
      for (const Eigen::Vector2d& d : in_frame) values.push_back(d[axis]);
      const double median = Median(values);
      for (const double value : values) deviations.push_back(std::abs(value - median));
    }
  }
  // A second difference has 1 + 4 + 1 times the variance of one observation.
  return 1.4826 * Median(std::move(deviations)) / std::sqrt(6.0);
}

std::vector<Camera> CamerasToTry(const Camera& camera) {
  if (camera.known) return {camera};
  std::vector<Camera> cameras;
  for (const double factor : {1.0, 0.84, 1.19, 0.7, 1.41, 0.6, 1.68, 0.5, 2.0}) {
    Camera& candidate = cameras.emplace_back(camera);
    candidate.fx *= factor;
    candidate.fy *= factor;
  }
  return cameras;
}

ClipMotion ClassifyMotion(const WhitenedTracks& whitened,
                          const Camera& camera,
                          const std::vector<FramePairMotion>& pairs,
                          double noise_px) {
  // Two views of a point with noise s leave a median of 1.67 s after the right rotation.
  constexpr double kBeyondNoise = 3.0;
  constexpr double kMinNoise = 0.3;  // px; less parallax than three times this says nothing
  const double threshold = kBeyondNoise * std::max(kMinNoise, noise_px);
  std::vector<FramePairMotion> widest(pairs);
  std::stable_sort(widest.begin(), widest.end(), [](const auto& a, const auto& b) {
    return a.motion_px > b.motion_px;
  });
  if (widest.empty() || widest.front().motion_px < threshold) return ClipMotion::kStatic;
  constexpr std::size_t kPairs = 12;
  widest.resize(std::min(widest.size(), kPairs));
  const auto largest_parallax = [&](const Camera& candidate) {
    std::vector<double> parallaxes;
    for (const FramePairMotion& pair : widest) {
      parallaxes.push_back(
          MeasureMotion(whitened, candidate, pair.frame_a, pair.frame_b).parallax_px);
    }
    return *std::max_element(parallaxes.begin(), parallaxes.end());
  };
  for (const Camera& candidate : CamerasToTry(camera)) {
    if (largest_parallax(candidate) < threshold) return ClipMotion::kRotation;
  }
  return ClipMotion::kParallax;
}

ClipMotion ClassifyDrift(const WhitenedTracks& whitened,
                         const Camera& camera,
                         const std::vector<FramePairMotion>& pairs) {
  constexpr std::size_t kPairs = 12;
  constexpr double kAlongEpipolarLines = 5.0;
  constexpr double kStill = 1.5;  // motion before the best rotation to that after it
  constexpr double kMinErrorPx = 0.05;
  for (Camera candidate : CamerasToTry(camera)) {
    candidate.known = true;  // this focal length is the hypothesis
    std::vector<double> along;
    std::vector<double> turned;
    for (const FramePairMotion& pair : std::span(pairs).first(std::min(pairs.size(), kPairs))) {
      std::vector<Eigen::Vector2d> xy_a;
      std::vector<Eigen::Vector2d> xy_b;
      for (const auto& [a, b] : whitened.CommonObservations(pair.frame_a, pair.frame_b)) {
        xy_a.push_back(whitened.observations()[a].xy);
        xy_b.push_back(whitened.observations()[b].xy);
      }
      TwoViewOptions two_view;
      two_view.min_inliers = 8;
      // Not to take for outliers what is to be measured.
      two_view.max_error_px = std::clamp(pair.parallax_px, two_view.max_error_px, 50.0);
      const TwoViewGeometry geometry = EstimateTwoViewGeometry(xy_a, xy_b, candidate, two_view);
      if (geometry.kind == TwoViewKind::kDegenerate) continue;
      along.push_back(geometry.parallax_px / std::max(geometry.error_px, kMinErrorPx));
      turned.push_back(geometry.motion_px / std::max(geometry.parallax_px, kMinErrorPx));
    }
    if (along.empty() || Median(std::move(along)) > kAlongEpipolarLines) continue;
    return Median(std::move(turned)) < kStill ? ClipMotion::kStatic : ClipMotion::kRotation;
  }
  return ClipMotion::kParallax;
}

}  // namespace cohort
