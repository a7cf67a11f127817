#include "datasets/readers/tum.h"

#include <array>

#include "datasets/readers/text_table.h"
#include "frontend/core/error.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/storage/input_file.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

std::vector<ImageList::Image> ReadList(const fs::path& file) {
  const TextTable table(file);
  std::vector<ImageList::Image> images;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    images.push_back({table.Text(row, 1), table.SecondsAsNs(row, 0)});
  }
  return images;
}

// The files of a list beside rgb.txt, by the frame to which they belong; empty without the list.
std::map<FrameIndex, fs::path> ReadCompanions(const fs::path& folder,
                                              const char* list,
                                              const std::vector<ImageList::Image>& images) {
  if (!fs::exists(folder / list)) return {};
  std::map<std::int64_t, fs::path> by_time;
  for (const ImageList::Image& file : ReadList(folder / list)) {
    RequirePictureName((folder / list).string(), file.name);
    by_time.emplace(file.timestamp_ns, folder / file.name);
  }
  return ByNearestTime(images, by_time);
}

Camera ReadCalibration(const fs::path& file) {
  const TextTable table(file);
  if (table.rows() == 0) ThrowError("{} is empty: give {}", file.string(), kCameraForm);
  std::vector<std::string> words;
  for (std::size_t i = 0; i < table.columns(0); ++i) words.push_back(table.Text(0, i));
  try {
    return CameraFromWords(words);
  } catch (const Error& error) {
    table.Fail(0, error.what());
  }
}

std::map<std::int64_t, Rigid3> ReadCamFromWorld(const fs::path& file) {
  const TextTable table(file);
  std::map<std::int64_t, Rigid3> by_time;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    std::array<double, 7> v{};
    for (std::size_t i = 0; i < v.size(); ++i) v[i] = table.Number(row, i + 1);
    const Eigen::Quaterniond rotation(v[6], v[3], v[4], v[5]);
    if (!(rotation.norm() > 0.5 && rotation.norm() < 2.0))
      table.Fail(row, "qx qy qz qw is not a unit quaternion");
    const Rigid3 world_from_cam{rotation.normalized(), {v[0], v[1], v[2]}};
    by_time.emplace(table.SecondsAsNs(row, 0), world_from_cam.Inverse());
  }
  return by_time;
}

}  // namespace

bool IsTum(const fs::path& folder) { return fs::exists(folder / kTumMark); }

ImageList ReadTum(const fs::path& folder) {
  ImageList list;
  list.name = FolderName(folder);
  list.root = folder;
  list.images = ReadList(folder / kTumMark);
  list.times = folder / kTumMark;
  if (const fs::path file = folder / "calibration.txt"; fs::exists(file)) {
    list.camera = ReadCalibration(file);
  }
  if (const fs::path file = folder / "groundtruth.txt"; fs::exists(file)) {
    list.cam_from_world = ByNearestTime(list.images, ReadCamFromWorld(file));
  }
  list.depth_files = ReadCompanions(folder, "depth.txt", list.images);
  list.occluder_files = ReadCompanions(folder, "occluder.txt", list.images);
  return list;
}

}  // namespace cohort
