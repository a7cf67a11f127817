#pragma once

#include <cstdint>
#include <map>
#include <span>

#include "backend/colmap/database.h"
#include "backend/colmap/model_io.h"
#include "frontend/tracks/imported_tracks.h"

namespace cohort {

// The tracks that a database's verified matches (inliers of two_view_geometries) make: keypoints
// that are joined by matches, over any number of pairs, are of one point. A point has one position
// in an image: a match that would give it two is left out (and counted in left_out), and the
// matches of the pair with most inliers are taken first, so that a false match neither joins two
// tracks nor costs them, as it would to drop all that it touches. Keypoints of an image at exactly
// the same position (SIFT's of several orientations) are one. Keypoints without a match are none.
//
// Images are found among the frames by name; tracks are numbered by their first image and keypoint
// there. The camera comes along, as a guess where COLMAP refines all of it or has only started with
// it (IsFoundByColmap, IsStartOfColmap). Throws Error naming `path` where there are no verified
// matches, or a position is not finite.
ImportedTracks TracksOfColmapDatabase(const ColmapDatabase& database,
                                      std::span<const FrameInfo> frames,
                                      const std::filesystem::path& path);

// The feature of every point: its id less 1, as in models of ours, or counted through where that
// needs more than 32 bits.
std::map<std::uint64_t, FeatureId> FeaturesOfColmapPoints(const ColmapModel& model);

// The tracks of a model's points (FeaturesOfColmapPoints), as far as its images are frames by name.
// Of two positions that a point has in one image the first counts; others go to left_out. The camera is
// the model's, taken for known: its poses fit no other. Throws Error naming `path` where cameras
// differ, a track points to what is not there, or a position is not finite.
ImportedTracks TracksOfColmapModel(const ColmapModel& model,
                                   std::span<const FrameInfo> frames,
                                   const std::filesystem::path& path);

}  // namespace cohort
