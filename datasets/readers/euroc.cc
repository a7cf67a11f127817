#include "datasets/readers/euroc.h"

#include <opencv2/core.hpp>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/readers/text_table.h"
#include "frontend/core/error.h"
#include "frontend/core/input_file.h"
#include "frontend/geometry/camera_fault.h"
#include "frontend/geometry/camera_text.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

struct CameraSensor {
  Camera camera;
  Rigid3 body_from_cam;
};

// The folder of cam0: FOLDER/mav0, or FOLDER itself.
fs::path Mav(const fs::path& folder) {
  return fs::exists(folder / "mav0") ? folder / "mav0" : folder;
}

std::vector<double> Numbers(const cv::FileNode& node,
                            const char* name,
                            const std::string& file,
                            std::optional<std::size_t> count = std::nullopt) {
  std::vector<double> numbers;
  for (const cv::FileNode& item : node) {
    if (!item.isReal() && !item.isInt()) ThrowError("{}: {} is not all numbers", file, name);
    numbers.push_back(static_cast<double>(item));
  }
  if (count && numbers.size() != *count) {
    ThrowError("{}: {} has {} numbers instead of {}", file, name, numbers.size(), *count);
  }
  return numbers;
}

// The text of a calibration. OpenCV's parser calls itself for what is within another, and the stack
// of a program ends: so this says how much of that there may be, comments left out.
std::string ReadShallowYaml(const fs::path& path) {
  constexpr std::uint64_t kMaxBytes = 1 << 16;
  constexpr std::ptrdiff_t kMostMarks =
      1000;  // a real one has a hundred, signs of numbers included
  const std::string text = ReadBytes(path, kMaxBytes);
  std::ptrdiff_t marks = 0;
  bool in_comment = false;
  for (const char c : text) {
    if (c == '#') in_comment = true;
    if (c == '\n') in_comment = false;
    if (!in_comment && std::string_view("-:[{").find(c) != std::string_view::npos) ++marks;
  }
  if (marks > kMostMarks) {
    ThrowError(
        "{} is no calibration: it has {} of the marks - : [ {{ that nest YAML, up to {} are read",
        path.string(),
        marks,
        kMostMarks);
  }
  return text;
}

CameraSensor ReadSensor(const fs::path& path) {
  const std::string file = path.string();
  CameraSensor sensor;
  const std::string text = ReadShallowYaml(path);
  try {
    // OpenCV wants a line that the data set's files do not have.
    const cv::FileStorage yaml(
        "%YAML:1.0\n---\n" + text,
        cv::FileStorage::READ | cv::FileStorage::MEMORY | cv::FileStorage::FORMAT_YAML);
    const auto model = static_cast<std::string>(yaml["camera_model"]);
    const auto distortion = static_cast<std::string>(yaml["distortion_model"]);
    const bool fisheye = distortion == "equidistant";
    const bool radtan = distortion == "radial-tangential" || distortion == "radtan";
    if (model != "pinhole" || !(radtan || fisheye)) {
      ThrowError(
          "{}: camera model '{}' with distortion '{}' is not supported: give pinhole with "
          "radial-tangential or equidistant, or read the image folder with --layout images",
          file,
          model,
          distortion);
    }
    const auto resolution = Numbers(yaml["resolution"], "resolution", file, 2);
    const auto f = Numbers(yaml["intrinsics"], "intrinsics", file, 4);
    if (!yaml["distortion_coefficients"].isSeq()) {
      ThrowError("{}: distortion_coefficients is missing: give [] where there is no distortion",
                 file);
    }
    const auto d = Numbers(yaml["distortion_coefficients"], "distortion_coefficients", file);
    const auto t = Numbers(yaml["T_BS"]["data"], "T_BS", file, 16);
    for (const double side : resolution) {
      if (!(side >= 1.0 && side <= kMaxPictureSidePx)) {
        ThrowError("{}: resolution {} x {} is none", file, resolution[0], resolution[1]);
      }
    }
    sensor.camera = {.width_px = static_cast<int>(resolution[0]),
                     .height_px = static_cast<int>(resolution[1]),
                     .fx = f[0],
                     .fy = f[1],
                     .cx = f[2],
                     .cy = f[3]};
    try {
      sensor.camera =
          WithDistortion(sensor.camera, fisheye ? CameraModel::kFisheye : CameraModel::kPinhole, d);
    } catch (const Error& error) {
      ThrowError("{}: distortion_coefficients: {}", file, error.what());
    }
    if (const std::string fault = FaultOf(sensor.camera); !fault.empty()) {
      ThrowError("{}: {}", file, fault);
    }
    const auto body_from_cam = RigidFromMatrix(
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(t.data()).topRows<3>());
    if (!body_from_cam) ThrowError("{}: T_BS is no rigid motion", file);
    sensor.body_from_cam = *body_from_cam;
  } catch (const cv::Exception& e) {
    ThrowError("{} is no YAML that OpenCV reads: {}", file, e.err);
  } catch (const std::logic_error& e) {  // what its parser trips over
    ThrowError("{} is no YAML that OpenCV reads: {}", file, e.what());
  }
  return sensor;
}

std::map<std::int64_t, Rigid3> ReadWorldFromBody(const fs::path& file) {
  const TextTable table(file);
  std::map<std::int64_t, Rigid3> by_time;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto number = [&](std::size_t column) { return table.Number(row, column); };
    const Eigen::Quaterniond rotation(number(4), number(5), number(6), number(7));
    if (!(rotation.norm() > 0.5 && rotation.norm() < 2.0))
      table.Fail(row, "qw qx qy qz is no unit quaternion");
    by_time.emplace(table.Integer(row, 0),
                    Rigid3{rotation.normalized(), {number(1), number(2), number(3)}});
  }
  return by_time;
}

}  // namespace

bool IsEuroc(const fs::path& folder) { return fs::exists(Mav(folder) / "cam0" / "data.csv"); }

ImageList ReadEuroc(const fs::path& folder) {
  const fs::path mav = Mav(folder);
  ImageList list;
  list.name = FolderName(folder);
  if (list.name == "mav0") list.name = FolderName(folder / "..");
  list.root = mav / "cam0" / "data";
  const TextTable images(mav / "cam0" / "data.csv");
  for (std::size_t row = 0; row < images.rows(); ++row) {
    list.images.push_back({images.Text(row, 1), images.Integer(row, 0)});
  }

  const fs::path sensor_file = mav / "cam0" / "sensor.yaml";
  if (!fs::exists(sensor_file)) return list;
  const CameraSensor sensor = ReadSensor(sensor_file);
  list.camera = sensor.camera;

  const fs::path truth_file = mav / "state_groundtruth_estimate0" / "data.csv";
  if (!fs::exists(truth_file)) return list;
  for (const auto& [frame, world_from_body] :
       ByNearestTime(list.images, ReadWorldFromBody(truth_file))) {
    list.cam_from_world.emplace(frame, (world_from_body * sensor.body_from_cam).Inverse());
  }
  return list;
}

}  // namespace cohort
