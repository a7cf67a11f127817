#include "backend/scene/clip_motion.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "backend/scene/two_view_geometry.h"
#include "frontend/core/statistics.h"

namespace cohort {

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
