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

// A COLMAP model of a video as tracks and a reconstruction that belong together: features and
// frames are the same in both. Images are found among the frames by name (FrameNames).
struct ModelOfClip {
  // The frames that have an image, the camera and the points' tracks; the rest is the clip's to fill
  // in (DescribeInput).
  TrackFile file;
  Reconstruction reconstruction;  // of these frames; points that are seen in one of them
  std::map<FrameIndex, ColmapImageId> image_ids;
  std::map<FeatureId, std::uint64_t> point_ids;  // less 1, or counted through where 32 bits are few
  std::size_t unknown_images = 0;                // that are no frame
  std::string an_unknown_image;
  std::size_t left_out = 0;  // second positions of a point in an image
};

// Throws Error naming `path` as TracksOfColmapModel does, and where a pose or a point is not finite.
ModelOfClip ReadModelOfClip(const ColmapModel& model,
                            std::span<const FrameInfo> frames,
                            const std::filesystem::path& path);

// `model` with the poses and points of `reconstruction`, whose frames and features are those of
// `clip`: ids, names and colours stay; images and points that it lacks are left out. Its camera
// replaces the model's where `with_camera`, as the same of COLMAP's models if that can hold it; where
// its focal length changes, every image has a camera of its own. What an image has is where its
// points are seen.
ColmapModel ReplaceInModel(const ColmapModel& model,
                           const ModelOfClip& clip,
                           const Reconstruction& reconstruction,
                           bool with_camera);

}  // namespace cohort
