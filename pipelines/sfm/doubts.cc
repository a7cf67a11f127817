#include "pipelines/sfm/doubts.h"

#include <fmt/format.h>

#include <filesystem>
#include <set>
#include <utility>
#include <vector>

#include "datasets/open_sequence.h"
#include "frontend/core/error.h"
#include "frontend/core/statistics.h"
#include "pipelines/sfm/fingerprint.h"
#include "pipelines/sfm/input.h"

namespace cohort {
namespace {

// The tracks from which a model was made, or that were measured again where it predicts them, lie
// within a pixel or two of its views; other tracks with the same ids lie anywhere.
constexpr double kOtherTracksShareOfWidth = 0.02;

// Median over the model's views of the distance to the track with that id in that frame, or a
// picture's width if there is none. 0 without views.
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

void CheckIsModelOf(const Reconstruction& model,
                    const std::string& model_name,
                    const TrackFile& file,
                    const std::string& tracks_name) {
  const auto fail = [&](const std::string& what) {
    ThrowError("{}: {}: give the model that was made from {}", model_name, what, tracks_name);
  };
  if (model.cam_from_world.empty()) return;
  if (model.camera.width_px != file.width_px || model.camera.height_px != file.height_px) {
    fail(fmt::format("its pictures are {}x{}, but those of the tracks are {}x{}",
                     model.camera.width_px,
                     model.camera.height_px,
                     file.width_px,
                     file.height_px));
  }
  std::set<FrameIndex> frames;
  for (const FrameInfo& frame : file.frames) frames.insert(frame.index);
  for (const auto& [frame, pose] : model.cam_from_world) {
    if (!frames.contains(frame)) fail(fmt::format("the tracks have no frame {}", ToInt(frame)));
  }
  for (const auto& [feature, point] : model.points) {
    if (file.tracks.Track(feature).empty()) {
      fail(fmt::format("its point {} is not a track", ToInt(feature)));
    }
  }
}

}  // namespace

std::string DoubtOfClip(const TrackFile& file,
                        const std::string& tracks_name,
                        const Sequence& clip) {
  if (IsStillTheClip(file, clip)) return "";
  return fmt::format("{} has changed since {} was made from it: tracks and pictures may not match",
                     file.source,
                     tracks_name);
}

std::string DoubtOfVideo(const TrackFile& file, const std::string& tracks_name) {
  if (!file.image_root.empty() || !std::filesystem::exists(file.source)) return "";
  return DoubtOfClip(file, tracks_name, *OpenSequence(file.source));
}

std::string DoubtOfMask(const TrackFile& file, const std::string& tracks_name) {
  const std::string& mask = file.meta.mask;
  if (mask.empty() || file.meta.mask_fingerprint.empty()) return "";
  if (FingerprintOfMasks(mask) == file.meta.mask_fingerprint) return "";
  return fmt::format("the mask {} has changed since {} was made with it", mask, tracks_name);
}

std::string DoubtOfModel(const Reconstruction& model,
                         const std::string& model_name,
                         const TrackFile& file,
                         const std::string& tracks_name) {
  CheckIsModelOf(model, model_name, file, tracks_name);
  const double distance_px = DistanceToViews(file, model);
  if (distance_px < kOtherTracksShareOfWidth * file.width_px) return "";
  return fmt::format(
      "{} was made from other tracks than {}: its points were observed {:.0f} px (median) from the "
      "tracks of the same ids: reconstruct these tracks",
      model_name,
      tracks_name,
      distance_px);
}

std::string DoubtOfMeasuring(const SecondPassFigures& figures) {
  if (figures.left <= figures.replaced) return "";
  return figures.Brief() + ": the scene does not match the model";
}

std::string DoubtOfIds(const TracksCsv& csv, const std::string& tracks_name) {
  if (csv.track_ids.empty()) return "";
  return fmt::format("{}: track ids need more than 32 bits and are renumbered from 0", tracks_name);
}

std::string DoubtOfCamera(const std::optional<Camera>& known) {
  if (!known) return "";
  const Camera& camera = *known;
  // No lens has such focal lengths; decimals with a comma cause them: 525,5 525,5 ...
  if (camera.fx > 2.0 * camera.fy || camera.fy > 2.0 * camera.fx) {
    return fmt::format(
        "the camera's focal lengths {:g} and {:g} px do not belong to a real lens: check the "
        "calibration, and that it writes decimals with points",
        camera.fx,
        camera.fy);
  }
  const bool is_inside = camera.cx >= 0.0 && camera.cy >= 0.0 && camera.cx < camera.width_px &&
                         camera.cy < camera.height_px;
  if (is_inside) return "";
  return fmt::format(
      "the camera's principal point ({:g}, {:g}) lies outside its pictures of {} x {}: check that "
      "the calibration is for pictures of this size",
      camera.cx,
      camera.cy,
      camera.width_px,
      camera.height_px);
}

}  // namespace cohort
