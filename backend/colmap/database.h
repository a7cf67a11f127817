#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "backend/colmap/camera_model.h"
#include "backend/scene/two_view_geometry.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// COLMAP's ids. An image is its frame's index + 1, in databases and models alike, so that either
// tells its frames without the other.
using ColmapImageId = std::uint32_t;
ColmapImageId ColmapImageIdOf(FrameIndex frame);
FrameIndex FrameOfColmapImage(ColmapImageId id);

// pair_id = 2147483647 * min(id1, id2) + max(id1, id2)
std::int64_t ColmapPairId(ColmapImageId id1, ColmapImageId id2);
std::pair<ColmapImageId, ColmapImageId> ColmapImagesOfPair(std::int64_t pair_id);

// two_view_geometries.config
enum class ColmapPairConfig : std::int32_t {
  kUndefined = 0,
  kDegenerate = 1,
  kCalibrated = 2,
  kUncalibrated = 3,
  kPlanar = 4,
  kPanoramic = 5,
};

using ColmapMatch = std::array<std::uint32_t, 2>;  // keypoint indices in image1, image2; from 0

// Everything in COLMAP's pixels. x2' F x1 = 0, x2' E x1 = 0 (normalised), x2 ~ H x1.
struct ColmapTwoViewGeometry {
  ColmapPairConfig config = ColmapPairConfig::kUndefined;
  std::vector<ColmapMatch> inliers;
  std::optional<Eigen::Matrix3d> fundamental;
  std::optional<Eigen::Matrix3d> essential;
  std::optional<Eigen::Matrix3d> homography;
  std::optional<Rigid3> cam2_from_cam1;

  // The same with the images exchanged: columns, matrices and pose.
  ColmapTwoViewGeometry Swapped() const;
};

struct ColmapPair {
  std::vector<ColmapMatch> matches;
  std::optional<ColmapTwoViewGeometry> geometry;  // none: no geometry holds, so no row

  ColmapPair Swapped() const;
};

struct ColmapImage {
  std::string name;
  std::vector<Eigen::Vector2f> keypoints;
};

// What a COLMAP 3.8 database holds of a clip; one camera takes all images.
struct ColmapDatabase {
  ColmapCamera camera;
  std::map<ColmapImageId, ColmapImage> images;
  std::map<std::pair<ColmapImageId, ColmapImageId>, ColmapPair> pairs;  // first < second

  // Swaps where image1 > image2. Throws Error on images or keypoint indices that are not there, a
  // pair that is there already, and a keypoint that is matched twice.
  void AddPair(ColmapImageId image1, ColmapImageId image2, ColmapPair pair);
};

struct ColmapDatabaseOptions {
  TwoViewOptions two_view;
  bool include_predicted = false;
  double max_relative_sigma = 1.5;
  int max_stride = 1024;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Group("two_view", o.two_view, "geometry of a pair of frames");
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
             "clip, or of their frame where that is larger: "
             "COLMAP weighs all alike; 0: none");
    v.Number("max_stride", o.max_stride, 1, 1 << 20, "longest distance of paired frames [frames]");
  }
};

// COLMAP weighs all observations alike, so it is better off without those that are known to be
// weak: with a deviation sqrt(trace(covariance) / 2) of more than `max_relative_sigma` times the
// median of the clip's, or of their frame's where that is larger (a blurred frame must keep what
// ties it to the others). They are marked predicted. What has no covariance stays.
TrackFile WithoutWeakObservations(const TrackFile& file, double max_relative_sigma);

// The keypoints of a frame in the order that the database has them: ascending features, observed
// ones only unless predicted ones are asked for. Keypoint index -> feature of a mapper's model.
std::vector<const Observation*> ColmapKeypoints(const TrackSet& tracks,
                                                FrameIndex frame,
                                                bool include_predicted);

// Tracks as pairs: frames s apart for s = 1, 2, 4, 8 ..., starting every max(1, s/2) frames, which
// costs three pairs a frame and gives COLMAP what all pairs would. A pair with fewer common tracks
// than min_inliers is left out. A match that contradicts its pair's geometry is in `matches`, not
// among the inliers: COLMAP's global mapper trusts those.
// `extra_pairs` are added to the grid. Throws Error on a frame without a name, a name that occurs
// twice, or tracks in unlisted frames.
ColmapDatabase BuildColmapDatabase(
    const TrackFile& file,
    const ColmapDatabaseOptions& options = {},
    const std::vector<std::pair<FrameIndex, FrameIndex>>& extra_pairs = {});

// A database in the 3.8 schema (user_version 3800), which 4.x opens too. Whole or not at all; an
// old file and its -wal and -shm are replaced. Throws Error naming the path.
void WriteColmapDatabase(const std::filesystem::path& path, const ColmapDatabase& database);
// Of the tracks WithoutWeakObservations.
void WriteColmapDatabase(const std::filesystem::path& path,
                         const TrackFile& file,
                         const ColmapDatabaseOptions& options = {});

// Reads the 3.8 schema, also with what 4.x adds when it opens such a file. Throws Error naming the
// path on a file that 4.x created, is damaged, or has several cameras.
ColmapDatabase ReadColmapDatabase(const std::filesystem::path& path);

}  // namespace cohort
