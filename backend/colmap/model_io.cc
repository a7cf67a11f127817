#include "backend/colmap/model_io.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <sstream>

#include "backend/colmap/tracks_to_database.h"
#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/input_record.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/frame_name.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

static_assert(std::endian::native == std::endian::little, "COLMAP's files are little-endian");

constexpr std::uint64_t kNoPoint3D = std::numeric_limits<std::uint64_t>::max();
constexpr std::array<std::uint8_t, 3> kPointColour{200, 200, 200};  // we keep no colours
constexpr std::int64_t kNsPerSecond = 1'000'000'000;

// ---- text ----

std::string CamerasText(const ColmapModel& model) {
  std::string text = fmt::format(
      "# Camera list with one line of data per camera:\n"
      "#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n# Number of cameras: {}\n",
      model.cameras.size());
  for (const auto& [id, camera] : model.cameras) {
    text += fmt::format(
        "{} {} {} {}", id, ColmapModelName(camera.model), camera.width_px, camera.height_px);
    for (const double p : camera.params) text += fmt::format(" {}", p);
    text += '\n';
  }
  return text;
}

std::string ImagesText(const ColmapModel& model) {
  std::string text = fmt::format(
      "# Image list with two lines of data per image:\n"
      "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
      "#   POINTS2D[] as (X, Y, POINT3D_ID)\n# Number of images: {}\n",
      model.images.size());
  for (const auto& [id, image] : model.images) {
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    const Eigen::Vector3d& t = image.cam_from_world.translation;
    text += fmt::format("{} {} {} {} {} {} {} {} {} {}\n",
                        id,
                        q.w(),
                        q.x(),
                        q.y(),
                        q.z(),
                        t.x(),
                        t.y(),
                        t.z(),
                        image.camera_id,
                        image.name);
    const char* separator = "";
    for (const ColmapPoint2D& p : image.points2d) {
      text += fmt::format("{}{} {} ", separator, p.xy.x(), p.xy.y());
      text += p.point3d ? fmt::to_string(*p.point3d) : "-1";
      separator = " ";
    }
    text += '\n';
  }
  return text;
}

std::string PointsText(const ColmapModel& model) {
  std::string text = fmt::format(
      "# 3D point list with one line of data per point:\n"
      "#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n"
      "# Number of points: {}\n",
      model.points.size());
  for (const auto& [id, point] : model.points) {
    text += fmt::format("{} {} {} {} {} {} {} {}",
                        id,
                        point.xyz.x(),
                        point.xyz.y(),
                        point.xyz.z(),
                        point.rgb[0],
                        point.rgb[1],
                        point.rgb[2],
                        point.error_px);
    for (const auto& [image, index] : point.track) text += fmt::format(" {} {}", image, index);
    text += '\n';
  }
  return text;
}

// Reads lines and their fields; errors name the current position.
class TextReader {
 public:
  explicit TextReader(fs::path path) : path_(std::move(path)), stream_(ReadBytes(path_)) {}

  // Reads the next line that is not a comment; with `may_be_empty` also an empty one. Returns false
  // at the end.
  bool NextLine(bool may_be_empty = false) {
    while (std::getline(stream_, line_)) {
      ++number_;
      Trim();
      position_ = 0;
      if (!line_.empty() && line_[0] == '#') continue;
      if (may_be_empty || !line_.empty()) return true;
    }
    return false;
  }

  bool AtEndOfLine() {
    position_ = std::min(line_.find_first_not_of(' ', position_), line_.size());
    return position_ == line_.size();
  }

  std::string Word() {
    if (AtEndOfLine()) Fail("a field is missing");
    const std::size_t end = std::min(line_.find(' ', position_), line_.size());
    std::string word = line_.substr(position_, end - position_);
    position_ = end;
    return word;
  }

  std::string Rest() {
    if (AtEndOfLine()) Fail("a field is missing");
    return line_.substr(position_);
  }

  template <typename T>
  T Number() {
    const std::string word = Word();
    T value{};
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size()) {
      Fail(fmt::format("\"{}\" is not a number in range", word));
    }
    return value;
  }

  [[noreturn]] void Fail(const std::string& what) const {
    ThrowError("{}, line {}: {}", path_.string(), number_, what);
  }

 private:
  // Like COLMAP: blanks at the ends of a line belong neither to a comment nor to a name.
  void Trim() {
    constexpr const char* kBlanks = " \t\r";
    line_.erase(0, std::min(line_.find_first_not_of(kBlanks), line_.size()));
    line_.erase(line_.find_last_not_of(kBlanks) + 1);
  }

  fs::path path_;
  std::istringstream stream_;
  std::string line_;
  std::size_t position_ = 0;
  int number_ = 0;
};

// Adds an entry for the next id, which must be new.
template <typename Map>
typename Map::mapped_type& AddEntry(Map& map, const char* what, TextReader& in) {
  const auto [entry, is_new] = map.try_emplace(in.Number<typename Map::key_type>());
  if (!is_new) in.Fail(fmt::format("a second {} {}", what, entry->first));
  return entry->second;
}

void ReadCamerasText(const fs::path& path, ColmapModel& model) {
  TextReader in(path);
  while (in.NextLine()) {
    ColmapCamera& camera = AddEntry(model.cameras, "camera", in);
    try {
      camera.model = ColmapModelFromName(in.Word());
    } catch (const Error& error) {
      in.Fail(error.what());
    }
    camera.width_px = in.Number<int>();
    camera.height_px = in.Number<int>();
    while (!in.AtEndOfLine()) camera.params.push_back(in.Number<double>());
    if (camera.params.size() != ColmapParameterCount(camera.model)) {
      in.Fail(fmt::format("{} needs {} parameters",
                          ColmapModelName(camera.model),
                          ColmapParameterCount(camera.model)));
    }
  }
}

void ReadImagesText(const fs::path& path, ColmapModel& model) {
  TextReader in(path);
  while (in.NextLine()) {
    ColmapModelImage& image = AddEntry(model.images, "image", in);
    Eigen::Quaterniond& q = image.cam_from_world.rotation;
    for (double* value : {&q.w(), &q.x(), &q.y(), &q.z()}) *value = in.Number<double>();
    for (double& value : image.cam_from_world.translation) value = in.Number<double>();
    image.camera_id = in.Number<std::uint32_t>();
    image.name = in.Rest();
    if (!in.NextLine(true)) in.Fail("the second line of the image is missing");
    while (!in.AtEndOfLine()) {
      ColmapPoint2D& point = image.points2d.emplace_back();
      point.xy.x() = in.Number<double>();
      point.xy.y() = in.Number<double>();
      const std::string id = in.Word();
      if (id == "-1") continue;
      std::uint64_t value = 0;
      const auto [end, error] = std::from_chars(id.data(), id.data() + id.size(), value);
      if (error != std::errc() || end != id.data() + id.size()) in.Fail("not a point id: " + id);
      point.point3d = value;
    }
  }
}

void ReadPointsText(const fs::path& path, ColmapModel& model) {
  TextReader in(path);
  while (in.NextLine()) {
    ColmapPoint3D& point = AddEntry(model.points, "point", in);
    for (double& value : point.xyz) value = in.Number<double>();
    for (std::uint8_t& value : point.rgb) value = in.Number<std::uint8_t>();
    point.error_px = in.Number<double>();
    while (!in.AtEndOfLine()) {
      const auto image = in.Number<ColmapImageId>();
      point.track.emplace_back(image, in.Number<std::uint32_t>());
    }
  }
}

// ---- binary ----

template <typename T>
void Put(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string CamerasBinary(const ColmapModel& model) {
  std::string bytes;
  Put(bytes, std::uint64_t{model.cameras.size()});
  for (const auto& [id, camera] : model.cameras) {
    Put(bytes, id);
    Put(bytes, static_cast<std::int32_t>(camera.model));
    Put(bytes, static_cast<std::uint64_t>(camera.width_px));
    Put(bytes, static_cast<std::uint64_t>(camera.height_px));
    for (const double p : camera.params) Put(bytes, p);
  }
  return bytes;
}

std::string ImagesBinary(const ColmapModel& model) {
  std::string bytes;
  Put(bytes, std::uint64_t{model.images.size()});
  for (const auto& [id, image] : model.images) {
    Put(bytes, id);
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    for (const double value : {q.w(), q.x(), q.y(), q.z()}) Put(bytes, value);
    for (const double value : image.cam_from_world.translation) Put(bytes, value);
    Put(bytes, image.camera_id);
    bytes.append(image.name.c_str(), image.name.size() + 1);
    Put(bytes, std::uint64_t{image.points2d.size()});
    for (const ColmapPoint2D& p : image.points2d) {
      Put(bytes, p.xy.x());
      Put(bytes, p.xy.y());
      Put(bytes, p.point3d.value_or(kNoPoint3D));
    }
  }
  return bytes;
}

std::string PointsBinary(const ColmapModel& model) {
  std::string bytes;
  Put(bytes, std::uint64_t{model.points.size()});
  for (const auto& [id, point] : model.points) {
    Put(bytes, id);
    for (const double value : point.xyz) Put(bytes, value);
    for (const std::uint8_t value : point.rgb) Put(bytes, value);
    Put(bytes, point.error_px);
    Put(bytes, std::uint64_t{point.track.size()});
    for (const auto& [image, index] : point.track) {
      Put(bytes, image);
      Put(bytes, index);
    }
  }
  return bytes;
}

class BinaryReader {
 public:
  explicit BinaryReader(fs::path path) : path_(std::move(path)), bytes_(ReadBytes(path_)) {}

  template <typename T>
  T Get() {
    Need(sizeof(T));
    T value;
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }

  // A count of records of at least that size: a damaged count is detected before memory is
  // allocated.
  std::uint64_t GetCount(std::size_t record_bytes) {
    const auto count = Get<std::uint64_t>();
    if (count > (bytes_.size() - position_) / record_bytes) Fail();
    return count;
  }

  // A side as an int; a value that does not fit becomes an invalid side.
  int GetSide() {
    return static_cast<int>(
        std::min<std::uint64_t>(Get<std::uint64_t>(), std::numeric_limits<int>::max()));
  }

  std::string GetText() {
    const std::size_t end = bytes_.find('\0', position_);
    if (end == std::string::npos) Fail();
    std::string text = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    return text;
  }

  [[noreturn]] void Fail(const std::string& what = "is truncated or damaged") const {
    ThrowError("{} {} at byte {}", path_.string(), what, position_);
  }

 private:
  void Need(std::size_t size) const {
    if (bytes_.size() - position_ < size) Fail();
  }

  fs::path path_;
  std::string bytes_;
  std::size_t position_ = 0;
};

// The same as AddEntry.
template <typename Map>
typename Map::mapped_type& AddBinaryEntry(Map& map, const char* what, BinaryReader& in) {
  const auto [entry, is_new] = map.try_emplace(in.Get<typename Map::key_type>());
  if (!is_new) in.Fail(fmt::format("has a second {} {}", what, entry->first));
  return entry->second;
}

void ReadCamerasBinary(const fs::path& path, ColmapModel& model) {
  BinaryReader in(path);
  for (auto n = in.GetCount(24); n > 0; --n) {
    ColmapCamera& camera = AddBinaryEntry(model.cameras, "camera", in);
    camera.model = static_cast<ColmapCameraModel>(in.Get<std::int32_t>());
    camera.width_px = in.GetSide();
    camera.height_px = in.GetSide();
    camera.params.resize(ColmapParameterCount(camera.model));
    for (double& p : camera.params) p = in.Get<double>();
  }
}

void ReadImagesBinary(const fs::path& path, ColmapModel& model) {
  BinaryReader in(path);
  for (auto n = in.GetCount(73); n > 0; --n) {
    ColmapModelImage& image = AddBinaryEntry(model.images, "image", in);
    Eigen::Quaterniond& q = image.cam_from_world.rotation;
    for (double* value : {&q.w(), &q.x(), &q.y(), &q.z()}) *value = in.Get<double>();
    for (double& value : image.cam_from_world.translation) value = in.Get<double>();
    image.camera_id = in.Get<std::uint32_t>();
    image.name = in.GetText();
    image.points2d.resize(in.GetCount(24));
    for (ColmapPoint2D& point : image.points2d) {
      point.xy.x() = in.Get<double>();
      point.xy.y() = in.Get<double>();
      const auto id = in.Get<std::uint64_t>();
      if (id != kNoPoint3D) point.point3d = id;
    }
  }
}

void ReadPointsBinary(const fs::path& path, ColmapModel& model) {
  BinaryReader in(path);
  for (auto n = in.GetCount(51); n > 0; --n) {
    ColmapPoint3D& point = AddBinaryEntry(model.points, "point", in);
    for (double& value : point.xyz) value = in.Get<double>();
    for (std::uint8_t& value : point.rgb) value = in.Get<std::uint8_t>();
    point.error_px = in.Get<double>();
    point.track.resize(in.GetCount(8));
    for (auto& [image, index] : point.track) {
      image = in.Get<ColmapImageId>();
      index = in.Get<std::uint32_t>();
    }
  }
}

void CheckReferences(const fs::path& folder, const ColmapModel& model) {
  for (const auto& [id, image] : model.images) {
    if (!model.cameras.contains(image.camera_id)) {
      ThrowError("model {}: image {} refers to camera {}, which does not exist",
                 folder.string(),
                 image.name,
                 image.camera_id);
    }
    RequirePictureName(fmt::format("model {}", folder.string()), image.name);
    const Eigen::Quaterniond& q = image.cam_from_world.rotation;
    const double norm = q.norm();
    if (!(norm > 0.0) || !std::isfinite(norm) || !image.cam_from_world.translation.allFinite()) {
      ThrowError("model {}: the pose of image {} is invalid: {} {}",
                 folder.string(),
                 image.name,
                 fmt::join(q.coeffs(), " "),
                 fmt::join(image.cam_from_world.translation, " "));
    }
    for (const ColmapPoint2D& point : image.points2d) {
      if (!point.xy.allFinite()) {
        ThrowError("model {}: a position in image {} is not finite", folder.string(), image.name);
      }
    }
  }
  for (const auto& [id, point] : model.points) {
    if (!point.xyz.allFinite()) {
      ThrowError("model {}: point {} is not finite", folder.string(), id);
    }
    for (const auto& [image, index] : point.track) {
      const auto it = model.images.find(image);
      if (it == model.images.end() || index >= it->second.points2d.size()) {
        ThrowError("model {}: point {} is observed at index {} of image {}, which does not exist",
                   folder.string(),
                   id,
                   index,
                   image);
      }
    }
  }
}

// ---- Reconstruction ----

Reconstruction CamerasOf(const ColmapModel& model) {
  const SharedCamera shared = ShareCamera(model);
  if (model.cameras.empty() || shared.other) {
    ThrowError(
        "the COLMAP model has {} cameras: a reconstruction of cohort has one for all frames, of "
        "which only the focal length may change: make the model with one camera (colmap "
        "feature_extractor --ImageReader.single_camera 1)",
        model.cameras.size());
  }
  Reconstruction reconstruction;
  reconstruction.camera = shared.camera;
  for (const auto& [id, image] : model.images) {
    const FrameIndex frame = FrameOfColmapImage(id);
    if (!shared.focal_scale.empty()) reconstruction.focal_scale[frame] = shared.focal_scale.at(id);
    reconstruction.cam_from_world[frame] = {image.cam_from_world.rotation.normalized(),
                                            image.cam_from_world.translation};
    reconstruction.frame_names[frame] = image.name;
  }
  return reconstruction;
}

void SortViews(Point3D& point) {
  std::sort(point.views.begin(), point.views.end(), [](const PointView& a, const PointView& b) {
    return a.frame < b.frame;
  });
}

std::string SecondsText(std::int64_t ns) {
  const std::uint64_t size =
      ns < 0 ? std::uint64_t{0} - static_cast<std::uint64_t>(ns) : static_cast<std::uint64_t>(ns);
  return fmt::format("{}{}.{:09}", ns < 0 ? "-" : "", size / kNsPerSecond, size % kNsPerSecond);
}

std::int64_t NsOfSeconds(const std::string& text, const TextReader& in) {
  // Digit by digit, because a double cannot hold seconds since 1970 to the nanosecond.
  const bool negative = !text.empty() && text[0] == '-';
  const std::size_t point = std::min(text.find('.'), text.size());
  std::string digits = text.substr(negative ? 1 : 0, point - (negative ? 1 : 0));
  std::string fraction = point < text.size() ? text.substr(point + 1) : "";
  fraction.resize(9, '0');
  digits += fraction;
  std::int64_t ns = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), ns);
  const bool has_digit = text.find_first_of("0123456789") != std::string::npos;
  if (!has_digit || ns < 0 || error != std::errc() || end != digits.data() + digits.size()) {
    in.Fail("not a time in seconds: " + text);
  }
  return negative ? -ns : ns;
}

// A line for every frame with a pose. A repeat's differs from its original's in the time alone.
std::string TrajectoryText(const Reconstruction& reconstruction) {
  std::map<FrameIndex, std::string> poses;
  std::map<FrameIndex, std::int64_t> times_ns = reconstruction.timestamps_ns;
  for (const auto& [frame, cam_from_world] : reconstruction.cam_from_world) {
    times_ns.emplace(frame, std::int64_t{ToInt(frame)} * kNsPerSecond);
    const Rigid3 world_from_cam = cam_from_world.Inverse();
    const Eigen::Vector3d& t = world_from_cam.translation;
    const Eigen::Quaterniond& q = world_from_cam.rotation;
    poses[frame] =
        fmt::format("{} {} {} {} {} {} {}\n", t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  for (const auto& [frame, original] : reconstruction.repeats) {
    times_ns[frame.index] = frame.timestamp_ns;
    poses[frame.index] = poses.at(original);
  }
  std::string text;
  for (const auto& [frame, pose] : poses) {
    text += fmt::format("{} {}", SecondsText(times_ns.at(frame)), pose);
  }
  return text;
}

}  // namespace

void WriteColmapModel(const fs::path& folder, const ColmapModel& model, ColmapModelFormat format) {
  if (format == ColmapModelFormat::kText) {
    WriteBytes(folder / "cameras.txt", CamerasText(model));
    WriteBytes(folder / "images.txt", ImagesText(model));
    WriteBytes(folder / "points3D.txt", PointsText(model));
  } else {
    WriteBytes(folder / "cameras.bin", CamerasBinary(model));
    WriteBytes(folder / "images.bin", ImagesBinary(model));
    WriteBytes(folder / "points3D.bin", PointsBinary(model));
  }
}

void AddModelToInputs(const fs::path& folder) {
  for (const char* name : {"cameras", "images", "points3D", "rigs", "frames"}) {
    for (const char* suffix : {".bin", ".txt"}) {
      InputRecord::Add(folder / fmt::format("{}{}", name, suffix));
    }
  }
  for (const char* name : {"trajectory.tum", "summary.json"}) InputRecord::Add(folder / name);
}

ColmapModel ReadColmapModel(const fs::path& folder) {
  AddModelToInputs(folder);
  const auto has = [&](const std::string& suffix) {
    return fs::exists(folder / ("cameras" + suffix)) && fs::exists(folder / ("images" + suffix)) &&
           fs::exists(folder / ("points3D" + suffix));
  };
  ColmapModel model;
  if (has(".bin")) {
    ReadCamerasBinary(folder / "cameras.bin", model);
    ReadImagesBinary(folder / "images.bin", model);
    ReadPointsBinary(folder / "points3D.bin", model);
  } else if (has(".txt")) {
    ReadCamerasText(folder / "cameras.txt", model);
    ReadImagesText(folder / "images.txt", model);
    ReadPointsText(folder / "points3D.txt", model);
  } else {
    ThrowError(
        "{} is not a model folder: it has no cameras, images and points3D files, .bin or .txt",
        folder.string());
  }
  CheckReferences(folder, model);
  return model;
}

std::optional<ColmapModelFolder> ReadLargestColmapModel(const fs::path& folder,
                                                        std::vector<std::string>* damaged) {
  std::set<fs::path> folders;  // in order
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory()) folders.insert(entry.path());
  }
  std::optional<ColmapModelFolder> largest;
  for (const fs::path& path : folders) {
    try {
      ColmapModel model = ReadColmapModel(path);
      if (!largest || model.images.size() > largest->model.images.size()) {
        largest = {path, std::move(model)};
      }
    } catch (const Error& error) {
      if (damaged == nullptr) throw;
      damaged->emplace_back(error.what());
    }
  }
  return largest;
}

SharedCamera ShareCamera(const ColmapModel& model) {
  SharedCamera shared;
  if (model.images.empty()) {
    if (!model.cameras.empty()) shared.camera = FromColmapCamera(model.cameras.begin()->second);
    return shared;
  }
  std::vector<std::pair<double, std::uint32_t>> focals;  // per image: fx, camera
  for (const auto& [id, image] : model.images) {
    const double fx = FromColmapCamera(model.cameras.at(image.camera_id)).fx;
    focals.emplace_back(fx, image.camera_id);
  }
  std::ranges::sort(focals);
  const ColmapCamera& median = model.cameras.at(focals[focals.size() / 2].second);
  shared.camera = FromColmapCamera(median);
  for (const auto& [id, image] : model.images) {
    const auto scale = FocalScaleOf(model.cameras.at(image.camera_id), median);
    if (!scale && !shared.other) shared.other = id;
    shared.focal_scale[id] = scale.value_or(1.0);
  }
  const auto is_one = [](const auto& scale) { return scale.second == 1.0; };
  if (std::ranges::all_of(shared.focal_scale, is_one)) shared.focal_scale.clear();
  return shared;
}

ColmapModel ToColmapModel(const Reconstruction& reconstruction) {
  const bool zooms = !reconstruction.focal_scale.empty() && !reconstruction.cam_from_world.empty();
  ColmapModel model;
  if (!zooms) model.cameras[1] = ToColmapCamera(reconstruction.camera);
  for (const auto& [frame, cam_from_world] : reconstruction.cam_from_world) {
    const auto name = reconstruction.frame_names.find(frame);
    ColmapModelImage& image = model.images[ColmapImageIdOf(frame)];
    image.cam_from_world = cam_from_world;
    image.name = name != reconstruction.frame_names.end() ? name->second : NumberedFrameName(frame);
    if (!zooms) continue;
    image.camera_id = ColmapImageIdOf(frame);
    model.cameras[image.camera_id] = ToColmapCamera(CameraOf(reconstruction, frame));
  }
  for (const auto& [feature, point] : reconstruction.points) {
    const std::uint64_t id = std::uint64_t{ToInt(feature)} + 1;
    ColmapPoint3D& written = model.points[id];
    written.xyz = point.in_world;
    written.rgb = kPointColour;
    written.error_px = point.mean_reprojection_px;
    for (const PointView& view : point.views) {
      const auto image = model.images.find(ColmapImageIdOf(view.frame));
      if (image == model.images.end()) {
        ThrowError(
            "point {} of the reconstruction is observed in frame {}, which is not registered",
            ToInt(feature),
            ToInt(view.frame));
      }
      auto& points2d = image->second.points2d;
      written.track.emplace_back(image->first, static_cast<std::uint32_t>(points2d.size()));
      points2d.push_back({view.xy + Eigen::Vector2d::Constant(kColmapPixelShift), id});
    }
  }
  return model;
}

Reconstruction FromColmapModel(const ColmapModel& model) {
  Reconstruction reconstruction = CamerasOf(model);
  for (const auto& [id, point] : model.points) {
    if (id == 0 || id - 1 > std::numeric_limits<std::uint32_t>::max()) {
      ThrowError("COLMAP point id {} is not one of cohort's: they are a feature's id + 1", id);
    }
    Point3D& read = reconstruction.points[FeatureId{static_cast<std::uint32_t>(id - 1)}];
    read.in_world = point.xyz;
    read.mean_reprojection_px = point.error_px;
    for (const auto& [image, index] : point.track) {
      read.views.push_back({FrameOfColmapImage(image),
                            model.images.at(image).points2d.at(index).xy -
                                Eigen::Vector2d::Constant(kColmapPixelShift)});
    }
    SortViews(read);
  }
  return reconstruction;
}

Reconstruction FromColmapModel(const ColmapModel& model, const TrackFile& file) {
  Reconstruction reconstruction = CamerasOf(model);
  NoteFrames(file, reconstruction);
  std::map<ColmapImageId, std::vector<const Observation*>> keypoints;
  for (const auto& [id, image] : model.images) {
    keypoints[id] = ColmapKeypoints(file.tracks, FrameOfColmapImage(id));
  }
  for (const auto& [id, point] : model.points) {
    Point3D read;
    read.in_world = point.xyz;
    read.mean_reprojection_px = point.error_px;
    std::optional<FeatureId> feature;
    for (const auto& [image, index] : point.track) {
      if (index >= keypoints.at(image).size()) {
        ThrowError(
            "the COLMAP model was not made from these tracks: image {} has {} keypoints, not {}",
            model.images.at(image).name,
            keypoints.at(image).size(),
            model.images.at(image).points2d.size());
      }
      const Observation& o = *keypoints.at(image)[index];
      if (feature && *feature != o.feature) {
        ThrowError(
            "the COLMAP model was not made from these tracks: point {} joins tracks {} and {}",
            id,
            ToInt(*feature),
            ToInt(o.feature));
      }
      feature = o.feature;
      read.views.push_back({o.frame, o.xy});
    }
    if (!feature) continue;
    SortViews(read);
    const auto [it, added] = reconstruction.points.try_emplace(*feature, read);
    if (!added && read.views.size() > it->second.views.size()) it->second = read;
  }
  return reconstruction;
}

const std::vector<std::string>& ModelFolderNames() {
  static const std::vector<std::string> names{"cameras.txt",
                                              "images.txt",
                                              "points3D.txt",
                                              "cameras.bin",
                                              "images.bin",
                                              "points3D.bin",
                                              "trajectory.tum",
                                              "points.ply",
                                              "summary.json",
                                              "tracks_without_point.csv",
                                              "camera_covariances.csv",
                                              "point_covariances.csv",
                                              "other_parts",
                                              "colmap"};
  return names;
}

bool IsOurModelFolder(const fs::path& folder) {
  return fs::exists(folder / "trajectory.tum") || fs::exists(folder / "summary.json");
}

std::string PointsPly(const ColmapModel& model) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n",
      model.points.size());
  for (const auto& [id, point] : model.points) {
    for (const double value : point.xyz) Put(bytes, static_cast<float>(value));
    for (const std::uint8_t value : point.rgb) Put(bytes, value);
  }
  return bytes;
}

void WriteReconstructionFiles(const fs::path& folder, const Reconstruction& reconstruction) {
  WriteReconstructionFiles(folder, reconstruction, ToColmapModel(reconstruction));
}

void WriteReconstructionFiles(const fs::path& folder,
                              const Reconstruction& reconstruction,
                              const ColmapModel& model) {
  WriteColmapModel(folder, model, ColmapModelFormat::kText);
  WriteColmapModel(folder, model, ColmapModelFormat::kBinary);
  WriteBytes(folder / "trajectory.tum", TrajectoryText(reconstruction));
  WriteBytes(folder / "points.ply", PointsPly(model));
}

void WriteReconstruction(const fs::path& folder, const Reconstruction& reconstruction) {
  OutputFolder out(folder, ModelFolderNames(), IsOurModelFolder);
  WriteReconstructionFiles(out.partial(), reconstruction);
  out.Commit();
}

Reconstruction ReadReconstruction(const fs::path& folder) {
  Reconstruction reconstruction = FromColmapModel(ReadColmapModel(folder));
  if (fs::exists(folder / "trajectory.tum")) {
    // One line per registered frame, ascending. If there are more, those with the pose of the line
    // before are repeats.
    std::size_t lines = 0;
    for (TextReader count(folder / "trajectory.tum"); count.NextLine();) ++lines;
    std::size_t repeats = lines - std::min(lines, reconstruction.cam_from_world.size());
    TextReader in(folder / "trajectory.tum");
    std::string pose_before;
    for (const auto& [frame, cam_from_world] : reconstruction.cam_from_world) {
      std::string time;
      std::string pose;
      while (true) {
        if (!in.NextLine()) in.Fail("fewer lines than registered frames");
        time = in.Word();
        pose = in.Rest();
        if (pose != pose_before || repeats == 0) break;
        --repeats;
      }
      reconstruction.timestamps_ns[frame] = NsOfSeconds(time, in);
      pose_before = std::move(pose);
    }
  }
  return reconstruction;
}

}  // namespace cohort
