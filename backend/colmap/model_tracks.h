#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>

#include "backend/colmap/model_io.h"
#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// A COLMAP model of a video as matching tracks and reconstruction, with the same features and
// frames. Images are matched to frames by name (FrameNames).
struct ModelOfClip {
  // The frames that have an image, the camera and the points' tracks; DescribeInput adds the rest.
  TrackFile file;
  Reconstruction reconstruction;  // of these frames; points seen in one of them
  std::map<FrameIndex, ColmapImageId> image_ids;
  std::map<FeatureId, std::uint64_t> point_ids;  // as FeaturesOfColmapPoints
  std::size_t unknown_images = 0;                // images that are not frames
  std::string an_unknown_image;
  std::size_t left_out = 0;  // second positions of a point in an image
};

// Throws Error naming `path` as TracksOfColmapModel does, and if a pose or a point is not finite.
ModelOfClip ReadModelOfClip(const ColmapModel& model,
                            std::span<const FrameInfo> frames,
                            const std::filesystem::path& path);

// `model` with the poses and points of `reconstruction`, whose frames and features are those of
// `clip`. Ids, names and colours stay; images and points that it lacks are removed. With
// `with_camera` its camera replaces the model's, in the same COLMAP model if that can represent it;
// if its focal length changes, every image has its own camera. An image's points are those seen in
// it.
ColmapModel ReplaceInModel(const ColmapModel& model,
                           const ModelOfClip& clip,
                           const Reconstruction& reconstruction,
                           bool with_camera);

}  // namespace cohort
