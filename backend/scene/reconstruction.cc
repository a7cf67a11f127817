#include "backend/scene/reconstruction.h"

#include <fmt/format.h>

namespace cohort {

ReconstructionSummary Summarize(const Reconstruction& reconstruction, std::size_t frames) {
  ReconstructionSummary summary;
  summary.registered = reconstruction.cam_from_world.size();
  summary.frames = frames;
  summary.points = reconstruction.points.size();
  double error_sum = 0.0;
  for (const auto& [feature, point] : reconstruction.points) {
    summary.observations += point.views.size();
    error_sum += point.mean_reprojection_px * static_cast<double>(point.views.size());
  }
  if (summary.points > 0) {
    summary.mean_track_length =
        static_cast<double>(summary.observations) / static_cast<double>(summary.points);
  }
  if (summary.observations > 0) {
    summary.mean_reprojection_px = error_sum / static_cast<double>(summary.observations);
  }
  return summary;
}

std::string ReconstructionSummary::Brief() const {
  return fmt::format(
      "{} of {} frames registered, {} points, {} observations, mean track length {:.1f}, mean "
      "reprojection error {:.2f} px, {:.1f} s: {}",
      registered,
      frames,
      points,
      observations,
      mean_track_length,
      mean_reprojection_px,
      seconds,
      termination);
}

}  // namespace cohort
