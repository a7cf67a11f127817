#pragma once

#include <filesystem>
#include <utility>
#include <vector>

#include "backend/colmap/database.h"
#include "backend/scene/focal_scale.h"
#include "backend/scene/two_view_geometry.h"
#include "frontend/core/options.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

struct ColmapDatabaseOptions {
  TwoViewOptions two_view;
  bool include_predicted = false;
  double max_relative_sigma = 1.5;
  int max_stride = 1024;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Group("two_view", o.two_view, "when two frames have a geometry");
    v.Flag("include_predicted",
           o.include_predicted,
           "Take positions that no image confirmed too, as if they were measured. They "
           "hold on to the other features alone, so a model of them confirms itself.",
           Tier::kCommon);
    v.Number("max_relative_sigma",
             o.max_relative_sigma,
             0.0,
             1e6,
             "leave out observations whose deviation is more than this times the median of the "
             "clip, or of their frame where that is larger: COLMAP weighs all alike; 0: none");
    v.Number("max_stride",
             o.max_stride,
             1,
             1 << 20,
             "longest distance of frames whose common tracks COLMAP is told [frames]");
  }
};

// COLMAP weighs all observations alike, so it is better off without those that are known to be
// weak: with a deviation sqrt(trace(covariance) / 2) of more than `max_relative_sigma` times the
// median of the clip's, or of their frame's where that is larger (a blurred frame must keep what
// ties it to the others). They are marked predicted or, where predicted ones are included too,
// dropped. What has no covariance stays.
TrackFile WithoutWeakObservations(const TrackFile& file, const ColmapDatabaseOptions& options);

// The keypoints of a frame in the order that the database has them: ascending features, observed
// ones only unless predicted ones are asked for. Keypoint index -> feature of a mapper's model.
std::vector<const Observation*> ColmapKeypoints(const TrackSet& tracks,
                                                FrameIndex frame,
                                                bool include_predicted);

// Tracks as pairs: frames s apart for s = 1, 2, 4, 8 ..., starting every max(1, s/2) frames, which
// costs three pairs a frame and gives COLMAP what all pairs would. A pair with fewer common tracks
// than min_inliers is left out. A match that contradicts its pair's geometry is in `matches`, not
// among the inliers: COLMAP's global mapper trusts those.
// `extra_pairs` are added to the grid. Where the focal length changes, every image has a camera of its
// own, and the geometry of a pair is that of its own two. Throws Error on a frame without a name, a name that occurs
// twice, or tracks in unlisted frames.
ColmapDatabase BuildColmapDatabase(
    const TrackFile& file,
    const ColmapDatabaseOptions& options = {},
    const std::vector<std::pair<FrameIndex, FrameIndex>>& extra_pairs = {},
    const FocalScales& focal_scale = {});

// Of the tracks WithoutWeakObservations.
void WriteColmapDatabase(const std::filesystem::path& path,
                         const TrackFile& file,
                         const ColmapDatabaseOptions& options = {},
                         const FocalScales& focal_scale = {});

}  // namespace cohort
