#pragma once

#include <span>

#include "backend/colmap/database.h"
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
// there. The camera comes along. Throws Error naming `path` where there are no verified matches, or
// a position is not finite.
ImportedTracks TracksOfColmapDatabase(const ColmapDatabase& database,
                                      std::span<const FrameInfo> frames,
                                      const std::filesystem::path& path);

}  // namespace cohort
