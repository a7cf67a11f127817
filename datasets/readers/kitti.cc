#include "datasets/readers/kitti.h"

#include <array>
#include <optional>
#include <utility>

#include "datasets/readers/image_folder.h"
#include "datasets/readers/text_table.h"
#include "frontend/core/error.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Matrix34 = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

struct ImageFolderOfCamera {
  const char* folder;
  std::size_t camera;  // its number in calib.txt
};
constexpr std::array<ImageFolderOfCamera, 3> kImageFolders{
    {{"image_0", 0}, {"image_l", 0}, {"image_2", 2}}};

std::optional<ImageFolderOfCamera> FindImages(const fs::path& folder) {
  for (const ImageFolderOfCamera& candidate : kImageFolders) {
    if (fs::is_directory(folder / candidate.folder)) return candidate;
  }
  return std::nullopt;
}

Matrix34 ReadMatrix(const TextTable& table, std::size_t row, std::size_t first_column) {
  if (table.columns(row) != first_column + 12) {
    table.Fail(row,
               fmt::format("{} numbers instead of the 12 of a 3x4 matrix",
                           table.columns(row) - first_column));
  }
  Matrix34 matrix;
  for (int i = 0; i < 12; ++i) {
    matrix(i / 4, i % 4) = table.Number(row, first_column + static_cast<std::size_t>(i));
  }
  return matrix;
}

// P of a camera. For camera 2, the line begins with `P2:`, or is the third of a file without such
// names.
Matrix34 ReadProjection(const fs::path& file, std::size_t camera) {
  const TextTable table(file);
  const std::string name = fmt::format("P{}:", camera);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const bool named = table.Text(row, 0).ends_with(':');
    if (named ? table.Text(row, 0) == name : row == camera) {
      Matrix34 p = ReadMatrix(table, row, named ? 1 : 0);
      if (p(0, 0) <= 0.0 || p(1, 1) <= 0.0) table.Fail(row, "the focal lengths must be above 0 px");
      return p;
    }
  }
  ThrowError("{} has no projection matrix of camera {}", file.string(), camera);
}

// Row i belongs to image i. If there are more rows and some images are missing, it would belong to
// another one.
void CheckRowsAreImages(const fs::path& file, std::size_t rows, const ImageList& list) {
  if (rows <= list.images.size()) return;
  for (std::size_t i = 0; i < list.images.size(); ++i) {
    const std::string number = fs::path(list.images[i].name).stem().string();
    const bool is_number =
        number.size() <= 9 && number.find_first_not_of("0123456789") == std::string::npos;
    if (!is_number || std::stoul(number) == i) continue;
    ThrowError(
        "{} has {} rows, but there are {} images, of which number {} is {}: give one for each",
        file.string(),
        rows,
        list.images.size(),
        i,
        list.images[i].name);
  }
}

std::map<FrameIndex, Rigid3> ReadCam0FromWorld(const fs::path& file, const ImageList& list) {
  const TextTable table(file);
  const std::size_t images = list.images.size();
  CheckRowsAreImages(file, table.rows(), list);
  std::map<FrameIndex, Rigid3> poses;
  for (std::size_t row = 0; row < std::min(table.rows(), images); ++row) {
    const auto world_from_cam0 = RigidFromMatrix(ReadMatrix(table, row, 0));
    if (!world_from_cam0) table.Fail(row, "the first three columns are not a rotation");
    poses.emplace(FrameIndex(row), world_from_cam0->Inverse());
  }
  return poses;
}

}  // namespace

bool IsKitti(const fs::path& folder) { return FindImages(folder).has_value(); }

ImageList ReadKitti(const fs::path& folder) {
  const auto source = FindImages(folder);
  Check(source.has_value(), "ReadKitti reads what IsKitti recognises");
  ImageList list;
  list.name = FolderName(folder);
  list.root = folder / source->folder;
  for (std::string& name : ImageNames(list.root)) {
    constexpr std::int64_t kFrameNs = 100'000'000;  // the recordings have 10 frames a second
    list.images.push_back(
        {std::move(name), static_cast<std::int64_t>(list.images.size()) * kFrameNs});
  }

  if (const fs::path file = folder / "times.txt"; fs::exists(file)) {
    const TextTable table(file);
    list.times = file;
    if (table.rows() < list.images.size()) {
      ThrowError("{} has {} times, but there are {} images: give one for each",
                 file.string(),
                 table.rows(),
                 list.images.size());
    }
    CheckRowsAreImages(file, table.rows(), list);
    for (std::size_t i = 0; i < list.images.size(); ++i) {
      list.images[i].timestamp_ns = table.SecondsAsNs(i, 0);
    }
  }

  Rigid3 cam_from_cam0;
  if (const fs::path file = folder / "calib.txt"; fs::exists(file)) {
    const Matrix34 p = ReadProjection(file, source->camera);
    list.camera = Camera{.fx = p(0, 0), .fy = p(1, 1), .cx = p(0, 2), .cy = p(1, 2)};
    const double z = p(2, 3);
    cam_from_cam0.translation = {
        (p(0, 3) - p(0, 2) * z) / p(0, 0), (p(1, 3) - p(1, 2) * z) / p(1, 1), z};
  }

  fs::path poses = folder / "poses.txt";
  if (!fs::exists(poses)) {
    poses = fs::weakly_canonical(folder / "../../poses") / (list.name + ".txt");
  }
  if (fs::exists(poses)) {
    for (const auto& [frame, cam0_from_world] : ReadCam0FromWorld(poses, list)) {
      list.cam_from_world.emplace(frame, cam_from_cam0 * cam0_from_world);
    }
  }
  return list;
}

}  // namespace cohort
