#include "datasets/readers/euroc.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "datasets/readers/text_table.h"
#include "frontend/core/error.h"
#include "frontend/geometry/camera_fault.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/storage/input_file.h"

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

// Reads the subset of YAML in which calibrations are written: lines `key: value`, lists of numbers
// in brackets over one or more lines, and comments. An indented key belongs to the last key that is
// not indented, and is named by both: T_BS.data. We parse it ourselves, because malicious files can
// make full YAML parsers exhaust time or stack. Throws Error naming the file.
class SensorText {
 public:
  explicit SensorText(const fs::path& path) : file_(path.string()) {
    constexpr std::uint64_t kMaxBytes = 1 << 16;
    constexpr std::size_t kMaxKeyBytes = 64;
    std::istringstream lines(ReadBytes(path, kMaxBytes));
    std::string section;
    std::string last;             // key whose value was read last
    std::string* list = nullptr;  // the list whose bracket is open
    std::string line;
    for (int number = 1; std::getline(lines, line); ++number) {
      line.resize(std::min(line.size(), line.find('#')));
      const std::string_view text = Trimmed(line);
      if (text.empty() || (list == nullptr && (text.starts_with('%') || text == "---"))) continue;
      if (list == nullptr) {
        const std::size_t end = text.find(':');
        const std::string_view key = text.substr(0, end);
        if (end == std::string_view::npos ||
            key.find_first_not_of(kKeyCharacters) != std::string_view::npos || key.empty() ||
            key.size() > kMaxKeyBytes ||
            (end + 1 < text.size() && text[end + 1] != ' ' && text[end + 1] != '\t')) {
          ThrowError("{} is not a calibration: line {} is not `key: value`", file_, number);
        }
        const bool indented = line[0] == ' ' || line[0] == '\t';
        if (!indented) section = key;
        std::string name = indented ? fmt::format("{}.{}", section, key) : std::string(key);
        const auto [at, is_new] = values_.emplace(std::move(name), Trimmed(text.substr(end + 1)));
        if (!is_new) ThrowError("{} is not a calibration: {} occurs twice", file_, at->first);
        last = at->first;
        if (at->second.starts_with('[')) list = &at->second;
      } else {
        if (text.find(':') != std::string_view::npos) break;
        list->append(" ").append(text);
      }
      if (list != nullptr && list->ends_with(']')) list = nullptr;
    }
    if (list != nullptr)
      ThrowError("{} is not a calibration: the list of {} is not closed", file_, last);
  }

  bool Has(const std::string& key) const { return values_.contains(key); }

  std::string Word(const std::string& key) const {
    const auto at = values_.find(key);
    if (at == values_.end()) return {};
    std::string word = at->second;
    if (word.size() >= 2 && word.front() == word.back() && (word[0] == '"' || word[0] == '\'')) {
      word = word.substr(1, word.size() - 2);
    }
    return word;
  }

  std::vector<double> Numbers(const std::string& key,
                              std::optional<std::size_t> count = std::nullopt) const {
    const auto at = values_.find(key);
    std::string_view rest = at == values_.end() ? std::string_view() : at->second;
    std::vector<double> numbers;
    if (at != values_.end()) {
      if (!rest.starts_with('[')) ThrowError("{}: {} is not a list in brackets", file_, key);
      rest = Trimmed(rest.substr(1, rest.size() - 2));
    }
    while (!rest.empty()) {
      const std::size_t end = rest.find(',');
      const std::string_view item = Trimmed(rest.substr(0, end));
      double number = 0.0;
      const auto [stop, fault] = std::from_chars(item.data(), item.data() + item.size(), number);
      if (fault != std::errc() || stop != item.data() + item.size() || !std::isfinite(number)) {
        ThrowError("{}: {} is not a list of numbers", file_, key);
      }
      numbers.push_back(number);
      rest = end == std::string_view::npos ? std::string_view() : rest.substr(end + 1);
    }
    if (count && numbers.size() != *count) {
      ThrowError("{}: {} has {} numbers instead of {}", file_, key, numbers.size(), *count);
    }
    return numbers;
  }

 private:
  static constexpr std::string_view kKeyCharacters =
      "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_";

  static std::string_view Trimmed(std::string_view text) {
    constexpr std::string_view kBlanks = " \t\r";
    const std::size_t first = text.find_first_not_of(kBlanks);
    if (first == std::string_view::npos) return {};
    return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
  }

  std::string file_;
  std::map<std::string, std::string> values_;
};

CameraSensor ReadSensor(const fs::path& path) {
  const std::string file = path.string();
  CameraSensor sensor;
  const SensorText yaml(path);
  const auto model = yaml.Word("camera_model");
  const auto distortion = yaml.Word("distortion_model");
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
  const auto resolution = yaml.Numbers("resolution", 2);
  const auto f = yaml.Numbers("intrinsics", 4);
  if (!yaml.Has("distortion_coefficients")) {
    ThrowError("{}: distortion_coefficients is missing: give [] where there is no distortion",
               file);
  }
  const auto d = yaml.Numbers("distortion_coefficients");
  const auto t = yaml.Numbers("T_BS.data", 16);
  for (const double side : resolution) {
    if (!(side >= 1.0 && side <= kMaxPictureSidePx)) {
      ThrowError("{}: resolution {} x {} is invalid", file, resolution[0], resolution[1]);
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
  if (!body_from_cam) ThrowError("{}: T_BS is not a rigid motion", file);
  sensor.body_from_cam = *body_from_cam;
  return sensor;
}

std::map<std::int64_t, Rigid3> ReadWorldFromBody(const fs::path& file) {
  const TextTable table(file);
  std::map<std::int64_t, Rigid3> by_time;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto number = [&](std::size_t column) { return table.Number(row, column); };
    const Eigen::Quaterniond rotation(number(4), number(5), number(6), number(7));
    if (!(rotation.norm() > 0.5 && rotation.norm() < 2.0))
      table.Fail(row, "qw qx qy qz is not a unit quaternion");
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
  list.times = mav / "cam0" / "data.csv";
  const TextTable images(list.times);
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
