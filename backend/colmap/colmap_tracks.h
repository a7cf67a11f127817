#pragma once

#include <cstdint>
#include <map>
#include <span>

#include "backend/colmap/database.h"
#include "backend/colmap/model_io.h"
#include "frontend/tracks/imported_tracks.h"

namespace cohort {

// The tracks formed by a database's verified matches (inliers of two_view_geometries): keypoints
// connected by matches, over any number of pairs, belong to one point. A point has one position in
// an image: a match that would give it two is dropped (and counted in left_out). Matches of the
// pair with the most inliers come first, so that a false match neither joins two tracks nor
// destroys them, as dropping all that it touches would. Keypoints at exactly the same position of
// an image (SIFT's of several orientations) are merged. Keypoints without a match are dropped.
//
// Images are matched to frames by name; tracks are numbered by their first image and keypoint
// there. The camera is included, as a guess if COLMAP refines all of it or has only started with it
// (IsFoundByColmap, IsStartOfColmap). Throws Error naming `path` if there are no verified matches
// or a position is not finite.
ImportedTracks TracksOfColmapDatabase(const ColmapDatabase& database,
                                      std::span<const FrameInfo> frames,
                                      const std::filesystem::path& path);

// The feature of every point: its id minus 1, as in our models, or a running number if that needs
// more than 32 bits.
std::map<std::uint64_t, FeatureId> FeaturesOfColmapPoints(const ColmapModel& model);

// The tracks of a model's points (FeaturesOfColmapPoints) in those images that are frames by name.
// If a point has two positions in an image, the first counts and others go to left_out. The camera
// is the model's and is treated as known, because its poses fit no other. Throws Error naming
// `path` if cameras differ, a track refers to a missing element, or a position is not finite.
ImportedTracks TracksOfColmapModel(const ColmapModel& model,
                                   std::span<const FrameInfo> frames,
                                   const std::filesystem::path& path);

}  // namespace cohort
