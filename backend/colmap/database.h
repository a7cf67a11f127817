#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "backend/colmap/camera_model.h"
#include "frontend/geometry/rigid3.h"
#include "frontend/tracks/observation.h"

namespace cohort {

// COLMAP's ids. An image id is its frame's index + 1, in databases and models alike, so that either
// gives the frames without the other.
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
  std::optional<ColmapTwoViewGeometry> geometry;  // unset if no geometry holds: no row

  ColmapPair Swapped() const;
};

struct ColmapImage {
  std::string name;
  std::vector<Eigen::Vector2f> keypoints;
};

// The contents of a COLMAP database for one clip; all images share one camera.
struct ColmapDatabase {
  ColmapCamera camera;
  // If the focal length changes: the camera of every image, which replaces the shared one.
  std::map<ColmapImageId, ColmapCamera> camera_of_image;
  std::map<ColmapImageId, ColmapImage> images;
  std::map<std::pair<ColmapImageId, ColmapImageId>, ColmapPair> pairs;  // first < second

  // Swaps if image1 > image2. Throws Error on unknown images or keypoint indices, a pair that
  // exists already, and a keypoint that is matched twice.
  void AddPair(ColmapImageId image1, ColmapImageId image2, ColmapPair pair);
};

// Writes a database in the 3.8 schema (user_version 3800), which 4.x opens too. Whole or not at
// all; an old file and its -wal and -shm are replaced. Throws Error naming the path.
void WriteColmapDatabase(const std::filesystem::path& path, const ColmapDatabase& database);

// The number of images with descriptors, as of COLMAP's SIFT, in a database. They take long to
// compute, and cohort writes none. 0 if the file is not a database.
std::int64_t CountDescribedImages(const std::filesystem::path& path);

// Reads the schemas of COLMAP 3.8 to 4.x. Rigs, frames and pose priors of newer ones do not affect
// these contents and are skipped. A geometry that COLMAP wrote as "unset" (zero matrices, the
// identity as a pose) becomes nullopt. Identical cameras (size, model, parameters, whether the
// focal length is a prior) are merged, and a keypoint may be matched twice. Throws Error naming the
// path if the file is damaged or has several cameras.
ColmapDatabase ReadColmapDatabase(const std::filesystem::path& path);

}  // namespace cohort
