#include "backend/scene/focal_scale.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace cohort {

double FocalScaleOf(const FocalScales& scales, FrameIndex frame) {
  const auto scale = scales.find(frame);
  return scale != scales.end() ? scale->second : 1.0;
}

double ZoomOf(const FocalScales& scales) {
  if (scales.empty()) return 1.0;
  const auto [shortest, longest] = std::ranges::minmax_element(
      scales, {}, [](const auto& frame_and_scale) { return frame_and_scale.second; });
  return longest->second / shortest->second;
}

Camera CameraOf(const Camera& camera, const FocalScales& scales, FrameIndex frame) {
  const double scale = FocalScaleOf(scales, frame);
  Camera scaled = camera;
  scaled.fx *= scale;
  scaled.fy *= scale;
  return scaled;
}

TrackSet AtOneFocalLength(const TrackSet& tracks, const Camera& camera, const FocalScales& scales) {
  if (scales.empty()) return tracks;
  // Distortion does not depend on the focal length, so all positions move towards or away from the
  // principal point.
  std::vector<Observation> observations(tracks.observations().begin(), tracks.observations().end());
  const Eigen::Vector2d middle(camera.cx, camera.cy);
  for (Observation& o : observations) {
    o.xy = middle + (o.xy - middle) / FocalScaleOf(scales, o.frame);
  }
  return TrackSet::Build(std::move(observations), {tracks.ends().begin(), tracks.ends().end()});
}

}  // namespace cohort
