#include "pipelines/jobs/track_doubts.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <utility>
#include <vector>

#include "datasets/open_sequence.h"
#include "frontend/core/statistics.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/reconstruct.h"

namespace cohort {
namespace {

// Tracks that a model was made of, or that were measured again where it says that they are, lie
// within a pixel or two of its views; others of the same ids anywhere.
constexpr double kOtherTracksShareOfWidth = 0.02;

// Median over the model's views of the distance to the track of that id in that frame; a picture's
// width where it has none there. 0 without views.
double DistanceToViews(const TrackFile& file, const Reconstruction& model) {
  std::vector<double> distances;
  for (const auto& [feature, point] : model.points) {
    for (const PointView& view : point.views) {
      const Observation* const seen = file.tracks.Find(feature, view.frame);
      distances.push_back(seen != nullptr ? (seen->xy - view.xy).norm() : file.width_px);
    }
  }
  return Median(std::move(distances));
}

// Empty: nothing.
std::string DoubtOf(const Camera& camera) {
  // No lens does that, decimals with a comma do: 525,5 525,5 ...
  if (camera.fx > 2.0 * camera.fy || camera.fy > 2.0 * camera.fx) {
    return fmt::format(
        "the camera's focal lengths {:g} and {:g} px are of no lens: is the calibration right, and "
        "are its decimals with points?",
        camera.fx,
        camera.fy);
  }
  const bool is_inside = camera.cx >= 0.0 && camera.cy >= 0.0 && camera.cx < camera.width_px &&
                         camera.cy < camera.height_px;
  if (is_inside) return "";
  return fmt::format(
      "the camera's principal point ({:g}, {:g}) lies outside its pictures of {} x {}: is the "
      "calibration of pictures of another size?",
      camera.cx,
      camera.cy,
      camera.width_px,
      camera.height_px);
}

}  // namespace

void WarnIfUnfinished(const TrackFile& file, const std::string& tracks) {
  if (file.complete) return;
  spdlog::warn("{}: tracking was interrupted; it holds {} frames", tracks, file.frames.size());
}

void WarnIfClipChanged(const TrackFile& file, const std::string& tracks, const Sequence& clip) {
  if (IsStillTheClip(file, clip)) return;
  spdlog::warn("{} is not what it was when {} was made of it: tracks and pictures may differ",
               file.source,
               tracks);
}

void WarnIfVideoChanged(const TrackFile& file, const std::string& tracks) {
  if (!file.image_root.empty() || !std::filesystem::exists(file.source)) return;
  WarnIfClipChanged(file, tracks, *OpenSequence(file.source));
}

void WarnIfModelOfOthers(const Reconstruction& model,
                         const std::string& folder,
                         const TrackFile& file,
                         const std::string& tracks) {
  CheckIsModelOf(model, folder, file, tracks);
  const double distance_px = DistanceToViews(file, model);
  if (distance_px < kOtherTracksShareOfWidth * file.width_px) return;
  spdlog::warn(
      "{} was made of other tracks than {}: its points were seen {:.0f} px (median) from where the "
      "tracks of their numbers are: reconstruct these",
      folder,
      tracks,
      distance_px);
}

void WarnIfCameraDoubtful(const std::optional<Camera>& camera) {
  const std::string doubt = camera ? DoubtOf(*camera) : "";
  if (!doubt.empty()) spdlog::warn("{}", doubt);
}

}  // namespace cohort
