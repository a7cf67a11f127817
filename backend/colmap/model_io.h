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

// COLMAP's sparse model as in its files, in COLMAP's pixels.
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
// does. Throws Error naming the file, and for text the line, if something is missing or damaged.
void WriteColmapModel(const std::filesystem::path& folder,
                      const ColmapModel& model,
                      ColmapModelFormat format);
ColmapModel ReadColmapModel(const std::filesystem::path& folder);

// Protects a model's files, read or not, from being replaced by an output of the run (InputRecord).
// ReadColmapModel does the same.
void AddModelToInputs(const std::filesystem::path& folder);

// The model with the most images of those that a mapper left in a folder (0, 1, ...), the first if
// several are equal; nullopt if the mapper failed. An unreadable model is an Error or, with
// `damaged`, is skipped and listed there, as from a mapper that died while writing.
struct ColmapModelFolder {
  std::filesystem::path folder;
  ColmapModel model;
};
std::optional<ColmapModelFolder> ReadLargestColmapModel(
    const std::filesystem::path& folder, std::vector<std::string>* damaged = nullptr);

// Image id = frame + 1, point id = feature + 1; an image's points are its views. There is one
// camera, or if the focal length changes one for every image, with the image's id.
ColmapModel ToColmapModel(const Reconstruction& reconstruction);
// The reverse, for a model that ToColmapModel made.
Reconstruction FromColmapModel(const ColmapModel& model);
// Converts a model that COLMAP made from BuildColmapDatabase(file): point -> keypoint index ->
// feature. If a feature has two points, the one with more views is kept.
Reconstruction FromColmapModel(const ColmapModel& model, const TrackFile& file);

// The cameras of a model's images as a single one with a changing focal length.
struct SharedCamera {
  Camera camera;                                // of an image whose focal length is the median
  std::map<ColmapImageId, double> focal_scale;  // of every image; empty: all cameras are equal
  std::optional<ColmapImageId> other;           // an image whose camera differs in other parameters
};
// For a model that has the cameras of its images. Throws Error on invalid parameters.
SharedCamera ShareCamera(const ColmapModel& model);

// The points as a PLY file: x, y, z [float], red, green, blue [uchar], binary.
std::string PointsPly(const ColmapModel& model);

// Writes a model folder: text and binary model, trajectory.tum (world_from_cam, `t tx ty tz qx qy
// qz qw`; t in seconds, or the frame's index if there is no time stamp), points.ply.
void WriteReconstructionFiles(const std::filesystem::path& existing_folder,
                              const Reconstruction& reconstruction);
// The same for `model`, which is the reconstruction with other ids and with colours.
void WriteReconstructionFiles(const std::filesystem::path& existing_folder,
                              const Reconstruction& reconstruction,
                              const ColmapModel& model);
// All names that a model folder may hold: for OutputFolder.
const std::vector<std::string>& ModelFolderNames();
// Whether we wrote a folder with those names: COLMAP's own models lack the files that it checks.
bool IsOurModelFolder(const std::filesystem::path& folder);
// Whole or not at all: OutputFolder and WriteReconstructionFiles.
void WriteReconstruction(const std::filesystem::path& folder, const Reconstruction& reconstruction);
// Reads a folder of ours, with the time stamps of its trajectory.tum.
Reconstruction ReadReconstruction(const std::filesystem::path& folder);

}  // namespace cohort
