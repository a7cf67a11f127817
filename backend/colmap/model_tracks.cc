#include "backend/colmap/model_tracks.h"

#include <algorithm>
#include <utility>

#include "backend/colmap/colmap_tracks.h"
#include "frontend/tracks/imported_tracks.h"

namespace cohort {

ModelOfClip ReadModelOfClip(const ColmapModel& model,
                            std::span<const FrameInfo> frames,
                            const std::filesystem::path& path) {
  ImportedTracks imported = TracksOfColmapModel(model, frames, path);
  ModelOfClip clip;
  clip.unknown_images = imported.unknown_images;
  clip.an_unknown_image = std::move(imported.an_unknown_image);
  clip.left_out = imported.left_out;
  clip.file.camera = imported.camera;
  clip.file.width_px = imported.camera->width_px;
  clip.file.height_px = imported.camera->height_px;
  clip.file.tracks = std::move(imported.tracks);
  clip.reconstruction.camera = *imported.camera;
  const auto focal_scale = ShareCamera(model).focal_scale;

  FrameNames names(frames);
  for (const auto& [id, image] : model.images) {
    const auto frame = names.Find(image.name);
    if (!frame) continue;
    const Eigen::Quaterniond& rotation = image.cam_from_world.rotation;
    if (!image.cam_from_world.translation.allFinite() || !rotation.coeffs().allFinite() ||
        !(rotation.norm() > 0.0)) {
      ThrowError("COLMAP model {}: the pose of image {} is not finite", path.string(), image.name);
    }
    clip.image_ids[*frame] = id;
    clip.reconstruction.cam_from_world[*frame] = {rotation.normalized(),
                                                  image.cam_from_world.translation};
    clip.reconstruction.frame_names[*frame] = image.name;
    if (!focal_scale.empty()) clip.reconstruction.focal_scale[*frame] = focal_scale.at(id);
  }
  for (const FrameInfo& frame : frames) {
    if (!clip.image_ids.contains(frame.index)) continue;
    clip.reconstruction.timestamps_ns[frame.index] = frame.timestamp_ns;
    clip.file.frames.push_back(frame);
  }

  for (const auto& [id, feature] : FeaturesOfColmapPoints(model)) {
    const auto track = clip.file.tracks.Track(feature);
    if (track.empty()) continue;
    const Eigen::Vector3d& xyz = model.points.at(id).xyz;
    if (!xyz.allFinite()) {
      ThrowError("COLMAP model {}: point {} is not finite", path.string(), id);
    }
    clip.point_ids[feature] = id;
    Point3D& point = clip.reconstruction.points[feature];
    point.in_world = xyz;
    for (const Observation& o : track) point.views.push_back({o.frame, o.xy});
  }
  UpdateReprojectionErrors(clip.reconstruction);
  return clip;
}

ColmapModel ReplaceInModel(const ColmapModel& model,
                           const ModelOfClip& clip,
                           const Reconstruction& reconstruction,
                           bool with_camera) {
  ColmapModel replaced;
  for (const auto& [frame, cam_from_world] : reconstruction.cam_from_world) {
    const ColmapImageId id = clip.image_ids.at(frame);
    const ColmapModelImage& before = model.images.at(id);
    const ColmapCamera& camera = model.cameras.at(before.camera_id);
    const bool own = with_camera && !reconstruction.focal_scale.empty();
    const std::uint32_t camera_id = own ? id : before.camera_id;
    replaced.images[id] = {cam_from_world, camera_id, before.name, {}};
    replaced.cameras[camera_id] =
        with_camera ? ToColmapCamera(CameraOf(reconstruction, frame), camera) : camera;
  }
  for (const auto& [feature, point] : reconstruction.points) {
    const std::uint64_t id = clip.point_ids.at(feature);
    ColmapPoint3D& written = replaced.points[id];
    written = {point.in_world, model.points.at(id).rgb, point.mean_reprojection_px, {}};
    for (const PointView& view : point.views) {
      const ColmapImageId image = clip.image_ids.at(view.frame);
      auto& points2d = replaced.images.at(image).points2d;
      written.track.emplace_back(image, static_cast<std::uint32_t>(points2d.size()));
      points2d.push_back({view.xy + Eigen::Vector2d::Constant(kColmapPixelShift), id});
    }
  }
  return replaced;
}

}  // namespace cohort
