#pragma once

#include <cstddef>
#include <filesystem>

#include "backend/colmap/tracks_to_database.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// Writes the covariance of every keypoint that WriteColmapDatabase(file, options) writes, in its
// order: by image, then by index. A path that ends with .npz gets arrays with one value per
// keypoint
//   image_id, keypoint (index in the image, from 0), track_id   int64
//   xy K x 2    float32, as the database has them: COLMAP's pixels
//   covariance K x 2 x 2   float64 [px^2]; NaN where none was measured
// and image_ids, image_names (bytes), one per image. Any other path gets CSV with the header
//   image_id,image_name,keypoint,track_id,x,y,cov_xx,cov_xy,cov_yy
// and empty fields where none was measured. Whole or not at all. Throws Error if no position has a
// covariance.
struct CovarianceCounts {
  std::size_t keypoints = 0;
  std::size_t without = 0;  // without a covariance
};
CovarianceCounts WriteKeypointCovariances(const std::filesystem::path& path,
                                          const TrackFile& file,
                                          const ColmapDatabaseOptions& options = {});

}  // namespace cohort
