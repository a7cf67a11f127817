#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "backend/colmap/database.h"
#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// COLMAP's sparse model as its files have it, in COLMAP's pixels.
struct ColmapPoint2D {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  std::optional<std::uint64_t> point3d;
};

struct ColmapModelImage {
  Rigid3 cam_from_world;
  std::uint32_t camera_id = 1;
  std::string name;
  std::vector<ColmapPoint2D> points2d;
};

struct ColmapPoint3D {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  std::array<std::uint8_t, 3> rgb{};
  double error_px = 0.0;                                       // mean reprojection error
  std::vector<std::pair<ColmapImageId, std::uint32_t>> track;  // image, index in its points2d
};

struct ColmapModel {
  std::map<std::uint32_t, ColmapCamera> cameras;
  std::map<ColmapImageId, ColmapModelImage> images;
  std::map<std::uint64_t, ColmapPoint3D> points;
};

enum class ColmapModelFormat { kText, kBinary };

// cameras, images, points3D .txt or .bin in an existing folder. Reading prefers .bin, as COLMAP
// does. Throws Error naming the file, and in text the line, of what is missing or damaged.
void WriteColmapModel(const std::filesystem::path& folder,
                      const ColmapModel& model,
                      ColmapModelFormat format);
ColmapModel ReadColmapModel(const std::filesystem::path& folder);

// No output of the run takes the place of a model's file, read or not (InputRecord). ReadColmapModel
// does it, too.
void AddModelToInputs(const std::filesystem::path& folder);

// Of the models that a mapper left in a folder (0, 1, ...) the one with most images, the first of
// equals; none if it failed. One that cannot be read is an Error or, where `damaged` is given,
// left out and named there: of a mapper that died while it wrote.
struct ColmapModelFolder {
  std::filesystem::path folder;
  ColmapModel model;
};
std::optional<ColmapModelFolder> ReadLargestColmapModel(
    const std::filesystem::path& folder, std::vector<std::string>* damaged = nullptr);

// Image id = frame + 1, point id = feature + 1, an image's points are the views of it. One camera, or
// where the focal length changes one for every image, of the image's id.
ColmapModel ToColmapModel(const Reconstruction& reconstruction);
// The reverse, for a model that ToColmapModel made.
Reconstruction FromColmapModel(const ColmapModel& model);
// A model that COLMAP made of BuildColmapDatabase(file): point -> keypoint index -> feature. Of two
// points of one feature the one with more views stays.
Reconstruction FromColmapModel(const ColmapModel& model,
                               const TrackFile& file,
                               bool include_predicted);

// The cameras of a model's images as one whose focal length changes.
struct SharedCamera {
  Camera camera;                                // of an image whose focal length is the median
  std::map<ColmapImageId, double> focal_scale;  // of every image; empty: all cameras are alike
  std::optional<ColmapImageId> other;           // an image whose camera differs in more
};
// Of a model that has the cameras of its images. Throws Error where one has parameters that are none.
SharedCamera ShareCamera(const ColmapModel& model);

// The points as a PLY file: x, y, z [float], red, green, blue [uchar], binary.
std::string PointsPly(const ColmapModel& model);

// A model folder: text and binary model, trajectory.tum (world_from_cam, `t tx ty tz qx qy qz qw`;
// t in seconds, the frame's index where there is no time stamp), points.ply.
void WriteReconstructionFiles(const std::filesystem::path& existing_folder,
                              const Reconstruction& reconstruction);
// The same of `model`, which is the reconstruction under other ids and with colours.
void WriteReconstructionFiles(const std::filesystem::path& existing_folder,
                              const Reconstruction& reconstruction,
                              const ColmapModel& model);
// All names that a model folder may hold: for OutputFolder.
const std::vector<std::string>& ModelFolderNames();
// Whether a folder of those names is ours: COLMAP's own models have neither of what is looked for.
bool IsOurModelFolder(const std::filesystem::path& folder);
// Whole or not at all: OutputFolder and WriteReconstructionFiles.
void WriteReconstruction(const std::filesystem::path& folder, const Reconstruction& reconstruction);
// A folder of ours, with the time stamps of its trajectory.tum.
Reconstruction ReadReconstruction(const std::filesystem::path& folder);

}  // namespace cohort
