#include "backend/judge/moving_share.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "backend/geometry/triangulation.h"
#include "backend/scene/row_poses.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

// Median distance of the observations from the point of a static world that explains them best
// [px].
double MisfitOfTrackPx(const std::vector<Ray>& rays,
                       const std::vector<double>& focals_px,
                       double distance) {
  // For parallel rays, a point far away.
  constexpr double kFar = 1e4;
  const Rigid3 world_from_cam = rays.front().cam_from_world.Inverse();
  const Eigen::Vector3d point = Triangulate(rays).value_or(
      world_from_cam * (kFar * distance * rays.front().n.homogeneous()).eval());
  std::vector<double> errors;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    errors.push_back(RayError(rays[i], point).value_or(1.0) * focals_px[i]);
  }
  return Median(std::move(errors));
}

}  // namespace

std::optional<double> MovingShare(const TrackFile& file, const Reconstruction& model) {
  if (model.points.empty()) return std::nullopt;
  constexpr std::size_t kLong = 10;
  const double moves_px = 0.0025 * std::hypot(model.camera.width_px, model.camera.height_px);
  const double distance = MedianDistance(model);
  const RowPoses rows(model);
  std::size_t all = 0;
  std::size_t moving = 0;
  const auto counts = [&model](const Observation& o) {
    return IsObserved(o) && model.cam_from_world.contains(o.frame);
  };
  for (const FeatureId feature : file.tracks.features()) {
    const auto track = file.tracks.Track(feature);
    const auto length = static_cast<std::size_t>(std::count_if(track.begin(), track.end(), counts));
    if (length < kLong) continue;
    all += length;
    const auto point = model.points.find(feature);
    if (point != model.points.end() && 2 * point->second.views.size() >= length) continue;
    std::vector<Ray> rays;
    std::vector<double> focals_px;  // of each
    for (const Observation& o : track) {
      if (!counts(o)) continue;
      const Camera camera = CameraOf(model, o.frame);
      focals_px.push_back(0.5 * (camera.fx + camera.fy));
      rays.push_back({rows.CamFromWorld(o.frame, o.xy), camera.Unproject(o.xy)});
    }
    if (MisfitOfTrackPx(rays, focals_px, distance) > moves_px) moving += length;
  }
  if (all == 0) return std::nullopt;
  return static_cast<double>(moving) / static_cast<double>(all);
}

}  // namespace cohort
