#pragma once

#include <filesystem>
#include <utility>
#include <vector>

#include "backend/colmap/database.h"
#include "backend/scene/focal_scale.h"
#include "backend/start/two_view_geometry.h"
#include "frontend/core/options.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

struct ColmapDatabaseOptions {
  TwoViewOptions two_view;
  double max_relative_sigma = 1.5;
  int max_stride = 1024;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Group("two_view", o.two_view, "two-view geometries");
    v.Number("max_relative_sigma",
             o.max_relative_sigma,
             0.0,
             1e6,
             "leave out observations whose standard deviation exceeds this multiple of the clip's "
             "median, or of their frame's median if that is larger, since COLMAP weights all "
             "observations equally; 0: leave out none");
    v.Number("max_stride",
             o.max_stride,
             1,
             1 << 20,
             "maximum distance of two frames whose common tracks are written as matches [frames]");
  }
};

// COLMAP weights all observations equally, so weak ones are better left out: those with a deviation
// sqrt(trace(covariance) / 2) above `max_relative_sigma` times the median of the clip, or of their
// frame if that is larger (a blurred frame must keep its connections). They are marked predicted.
// Observations without a covariance stay.
TrackFile WithoutWeakObservations(const TrackFile& file, const ColmapDatabaseOptions& options);

// The keypoints of a frame in the database's order: its observed positions, ascending features. It
// maps the keypoint indices of a mapper's model to features.
std::vector<const Observation*> ColmapKeypoints(const TrackSet& tracks, FrameIndex frame);

// Tracks as pairs of frames s apart for s = 1, 2, 4, 8 ..., starting every max(1, s/2) frames. This
// costs three pairs per frame and gives COLMAP as much as all pairs. A pair with fewer common
// tracks than min_inliers is left out. A match that contradicts its pair's geometry is in
// `matches`, not among the inliers: COLMAP's global mapper trusts those. `extra_pairs` are added to
// the grid. If the focal length changes, every image has its own camera, and a pair's geometry uses
// its two. Throws Error on a frame without a name, a name that occurs twice, or tracks in unlisted
// frames.
ColmapDatabase BuildColmapDatabase(
    const TrackFile& file,
    const ColmapDatabaseOptions& options = {},
    const std::vector<std::pair<FrameIndex, FrameIndex>>& extra_pairs = {},
    const FocalScales& focal_scale = {});

// Writes the tracks WithoutWeakObservations.
void WriteColmapDatabase(const std::filesystem::path& path,
                         const TrackFile& file,
                         const ColmapDatabaseOptions& options = {},
                         const FocalScales& focal_scale = {});

}  // namespace cohort
