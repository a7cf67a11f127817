#include "pipelines/sfm/scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "backend/colmap/model_io.h"
#include "backend/scene/row_poses.h"
#include "frontend/core/statistics.h"
#include "frontend/image/write_image.h"
#include "frontend/storage/output.h"
#include "pipelines/json/json_file.h"
#include "pipelines/sfm/for_each_frame.h"
#include "pipelines/sfm/further_points.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// CV_8UC3, BGR.
cv::Mat BgrOf(const Frame& frame) {
  cv::Mat picture = frame.color.empty() ? frame.gray : frame.color;
  if (picture.depth() == CV_16U) picture.convertTo(picture, CV_8U, 1.0 / 257.0);
  cv::Mat bgr;
  switch (picture.channels()) {
    case 1:
      cv::cvtColor(picture, bgr, cv::COLOR_GRAY2BGR);
      return bgr;
    case 4:
      cv::cvtColor(picture, bgr, cv::COLOR_BGRA2BGR);
      return bgr;
    default:
      return picture;
  }
}

// Mean square gradient of the picture at half its size, where noise has less influence.
double SharpnessOf(const cv::Mat& bgr) {
  cv::Mat gray;
  cv::cvtColor(bgr, gray, cv::COLOR_BGR2GRAY);
  cv::pyrDown(gray, gray);
  cv::Mat dx;
  cv::Mat dy;
  cv::Sobel(gray, dx, CV_32F, 1, 0);
  cv::Sobel(gray, dy, CV_32F, 0, 1);
  return (dx.dot(dx) + dy.dot(dy)) / static_cast<double>(gray.total());
}

using Views = std::vector<std::pair<FeatureId, Eigen::Vector2d>>;  // ascending features

// Upper quartile of the motion of the points seen in both frames [px]; nullopt if there are too
// few.
std::optional<double> MotionBetween(const Views& from, const Views& to) {
  constexpr std::size_t kEnough = 5;
  constexpr double kQuantile = 0.75;
  std::vector<double> distances;
  auto other = to.begin();
  for (const auto& [feature, xy] : from) {
    while (other != to.end() && other->first < feature) ++other;
    if (other != to.end() && other->first == feature)
      distances.push_back((xy - other->second).norm());
  }
  if (distances.size() < kEnough) return std::nullopt;
  return Quantile(std::move(distances), kQuantile);
}

// Counts of 8-bit intensities over all frames.
using Histogram = std::array<double, 256>;

void Count(const cv::Mat& bgr, Histogram& histogram) {
  cv::Mat gray;
  cv::cvtColor(bgr, gray, cv::COLOR_BGR2GRAY);
  for (auto it = gray.begin<std::uint8_t>(); it != gray.end<std::uint8_t>(); ++it) {
    ++histogram[*it];
  }
}

double QuantileOf(const Histogram& histogram, double share) {
  double left = share * std::accumulate(histogram.begin(), histogram.end(), 0.0);
  for (std::size_t v = 0; v < histogram.size(); ++v) {
    left -= histogram[v];
    if (left <= 0.0) return static_cast<double>(v) / 255.0;
  }
  return 1.0;
}

double MeanOf(const Histogram& histogram, const ToneCurve& tone) {
  double sum = 0.0;
  for (std::size_t v = 0; v < histogram.size(); ++v) {
    sum += histogram[v] * tone(static_cast<double>(v) / 255.0);
  }
  return sum / std::accumulate(histogram.begin(), histogram.end(), 0.0);
}

// Stretches to the whole range and brings its middle to a pleasant brightness, unless it is already
// brighter.
ToneCurve Brighter(const Histogram& histogram) {
  constexpr double kTail = 0.005;
  constexpr double kMiddle = 0.4;
  ToneCurve tone;
  tone.black = QuantileOf(histogram, kTail);
  tone.white = std::max(QuantileOf(histogram, 1.0 - kTail), tone.black + 4.0 / 255.0);
  const double median = (QuantileOf(histogram, 0.5) - tone.black) / (tone.white - tone.black);
  tone.gamma = std::clamp(std::log(kMiddle) / std::log(std::clamp(median, 0.01, 0.99)), 0.4, 1.0);
  return MeanOf(histogram, tone) > MeanOf(histogram, {}) ? tone : ToneCurve{};
}

cv::Mat TableOf(const ToneCurve& tone) {
  cv::Mat table(1, 256, CV_8UC1);
  for (int v = 0; v < 256; ++v) {
    table.at<std::uint8_t>(v) = cv::saturate_cast<std::uint8_t>(255.0 * tone(v / 255.0));
  }
  return table;
}

double BrightnessOf(const cv::Mat& bgr) {
  const cv::Scalar mean = cv::mean(bgr);
  return (0.114 * mean[0] + 0.587 * mean[1] + 0.299 * mean[2]) / 255.0;
}

// What is determined about the clip before any picture is written.
struct Survey {
  std::vector<SceneCandidate> candidates;
  std::vector<double> brightness;
  std::map<FeatureId, Eigen::Vector3d> colour_sums;  // blue, green, red 0..255
  std::map<FeatureId, int> colour_counts;
  Histogram histogram{};
  std::set<FrameIndex> masked;  // frames with a mask
};

std::map<FrameIndex, Views> ViewsByFrame(const Reconstruction& model) {
  std::map<FrameIndex, Views> views;
  for (const auto& [feature, point] : model.points) {
    for (const PointView& view : point.views) views[view.frame].emplace_back(feature, view.xy);
  }
  return views;
}

void AddColours(const cv::Mat& bgr, const Views& views, Survey& survey) {
  for (const auto& [feature, xy] : views) {
    const int x = std::clamp(static_cast<int>(std::lround(xy.x())), 0, bgr.cols - 1);
    const int y = std::clamp(static_cast<int>(std::lround(xy.y())), 0, bgr.rows - 1);
    const auto& pixel = bgr.at<cv::Vec3b>(y, x);
    survey.colour_sums.try_emplace(feature, Eigen::Vector3d::Zero()).first->second +=
        Eigen::Vector3d(pixel[0], pixel[1], pixel[2]);
    ++survey.colour_counts[feature];
  }
}

Survey SurveyClip(const TrackFile& file,
                  const Reconstruction& model,
                  Sequence& sequence,
                  const StageProgress& progress) {
  Survey survey;
  const std::map<FrameIndex, Views> views = ViewsByFrame(model);
  const Views none;
  const double diagonal_px = std::hypot(model.camera.width_px, model.camera.height_px);
  const Views* before = nullptr;
  ForEachFrame(file, sequence, "look", progress, [&](const Frame& frame) {
    const cv::Mat bgr = BgrOf(frame);
    if (bgr.cols != model.camera.width_px || bgr.rows != model.camera.height_px) {
      ThrowError("{} is {}x{}, but the model's camera is {}x{}: they do not belong together",
                 frame.name,
                 bgr.cols,
                 bgr.rows,
                 model.camera.width_px,
                 model.camera.height_px);
    }
    survey.brightness.push_back(BrightnessOf(bgr));
    if (!frame.mask.empty()) survey.masked.insert(frame.index);
    if (!model.cam_from_world.contains(frame.index)) return;
    Count(bgr, survey.histogram);
    const auto seen = views.find(frame.index);
    const Views& now = seen != views.end() ? seen->second : none;
    AddColours(bgr, now, survey);
    SceneCandidate candidate{frame.index, 0.0, SharpnessOf(bgr)};
    if (before != nullptr) {
      // Without common points, the motion counts as the largest possible.
      const auto motion_px = MotionBetween(*before, now);
      candidate.motion = motion_px ? *motion_px / diagonal_px : 1.0;
    }
    before = &now;
    survey.candidates.push_back(candidate);
  });
  return survey;
}

// The position of every pixel of `to` in pictures of `from`.
cv::Mat UndistortionMap(const Camera& from, const Camera& to) {
  cv::Mat map(to.height_px, to.width_px, CV_32FC2);
  for (int y = 0; y < to.height_px; ++y) {
    for (int x = 0; x < to.width_px; ++x) {
      const auto xy = from.Project({(x - to.cx) / to.fx, (y - to.cy) / to.fy, 1.0});
      map.at<cv::Vec2f>(y, x) =
          xy ? cv::Vec2f(static_cast<float>(xy->x()), static_cast<float>(xy->y()))
             : cv::Vec2f(-1.0F, -1.0F);
    }
  }
  return map;
}

bool IsSamePinhole(const Camera& from, const Camera& to) {
  return !from.HasDistortion() && from.fx == to.fx && from.fy == to.fy && from.cx == to.cx &&
         from.cy == to.cy;
}

// Undistorts the pictures of one camera; reuses the map while the focal length stays the same.
class Undistorter {
 public:
  cv::Mat Undistort(const cv::Mat& picture,
                    const Camera& from,
                    const Camera& to,
                    int interpolation = cv::INTER_CUBIC) {
    if (fx_ != from.fx) {
      fx_ = from.fx;
      map_ = IsSamePinhole(from, to) ? cv::Mat() : UndistortionMap(from, to);
    }
    if (map_.empty()) return picture;
    cv::Mat undistorted;
    cv::remap(picture, undistorted, map_, {}, interpolation, cv::BORDER_REPLICATE);
    return undistorted;
  }

 private:
  std::optional<double> fx_;  // of the current map
  cv::Mat map_;
};

// The focal length of each picture's undistorted camera divided by that of `undistorted`.
FocalScales UndistortedScales(const Reconstruction& model,
                              const Camera& undistorted,
                              const std::vector<FrameIndex>& images) {
  FocalScales scales;
  if (model.focal_scale.empty()) return scales;
  for (const FrameIndex frame : images) {
    scales[frame] = UndistortedCamera(CameraOf(model, frame)).fx / undistorted.fx;
  }
  return scales;
}

// Viewers clip everything nearer than a fixed distance, so the scale makes the median distance from
// which points are seen equal to ten.
double ScaleOf(const Reconstruction& model) {
  constexpr double kDistance = 10.0;
  const double median = MedianDistance(model);
  return median > 0.0 ? kDistance / median : 1.0;
}

// No frame of a clip has such a name; 000001.png could be its frame 0.
constexpr std::string_view kImagePrefix = "scene_";

std::string ImageName(FrameIndex frame) {
  return fmt::format("{}{:06}.jpg", kImagePrefix, ToInt(frame));
}

// As COLMAP names the mask of a picture; Nerfstudio is told the name.
std::string MaskName(FrameIndex frame) { return ImageName(frame) + ".png"; }

bool IsImageName(const std::string& name) {
  const std::string_view number =
      std::string_view(name).substr(name.starts_with(kImagePrefix) ? kImagePrefix.size() : 0);
  return number.ends_with(".jpg") && number.size() > 4 &&
         std::all_of(number.begin(), number.end() - 4, [](char c) { return c >= '0' && c <= '9'; });
}

bool IsMaskName(const std::string& name) {
  constexpr std::string_view kEnding = ".png";
  return name.ends_with(kEnding) && IsImageName(name.substr(0, name.size() - kEnding.size()));
}

// The model in the scene's world, with the undistorted camera and the chosen frames, and the points
// that at least two of them see: COLMAP aborts on a track of one.
Reconstruction SceneModel(const Reconstruction& model, const SceneFigures& figures) {
  const RowPoses rows(model);
  const Rigid3 model_from_scene = figures.scene_from_model.Inverse();
  Reconstruction scene;
  scene.camera = figures.camera;
  scene.focal_scale = figures.focal_scale;
  for (const FrameIndex frame : figures.images) {
    Rigid3& cam_from_scene = scene.cam_from_world[frame];
    cam_from_scene = model.cam_from_world.at(frame) * model_from_scene;
    cam_from_scene.translation *= figures.scale;
    scene.frame_names[frame] = ImageName(frame);
  }
  for (const auto& [feature, point] : model.points) {
    Point3D in_scene;
    in_scene.in_world = figures.scale * (figures.scene_from_model * point.in_world);
    for (const PointView& view : point.views) {
      const auto pose = scene.cam_from_world.find(view.frame);
      if (pose == scene.cam_from_world.end()) continue;
      const Camera camera = CameraOf(model, view.frame);
      Eigen::Vector2d xy = view.xy;
      if (model.readout != 0.0) {  // moves views to where a global shutter would have seen them
        const auto of_row = rows.Project(camera, view.frame, point.in_world);
        const auto of_middle = camera.Project(model.cam_from_world.at(view.frame) * point.in_world);
        if (!of_row || !of_middle) continue;
        xy += *of_middle - *of_row;
      }
      const auto undistorted =
          CameraOf(scene, view.frame).Project(camera.Unproject(xy).homogeneous().eval());
      if (undistorted && scene.camera.Contains(*undistorted)) {
        in_scene.views.push_back({view.frame, *undistorted});
      }
    }
    if (in_scene.views.size() > 1) scene.points[feature] = std::move(in_scene);
  }
  UpdateReprojectionErrors(scene);
  return scene;
}

// Of the points that have a view.
std::map<FeatureId, Eigen::Vector3d> MeanColours(const Survey& survey) {
  std::map<FeatureId, Eigen::Vector3d> means;
  for (const auto& [feature, sum] : survey.colour_sums) {
    means[feature] = sum / survey.colour_counts.at(feature);
  }
  return means;
}

std::array<std::uint8_t, 3> RgbOf(const Eigen::Vector3d& bgr,
                                  const std::optional<ToneCurve>& tone) {
  std::array<std::uint8_t, 3> rgb{};
  for (int c = 0; c < 3; ++c) {
    const double value = bgr[2 - c] / 255.0;
    rgb[static_cast<std::size_t>(c)] =
        cv::saturate_cast<std::uint8_t>(255.0 * (tone ? (*tone)(value) : value));
  }
  return rgb;
}

Json MatrixToJson(const Eigen::Matrix<double, Eigen::Dynamic, 4>& matrix) {
  Json rows = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r) {
    rows.push_back({matrix(r, 0), matrix(r, 1), matrix(r, 2), matrix(r, 3)});
  }
  return rows;
}

Eigen::Matrix4d MatrixOf(const Rigid3& motion) {
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = motion.rotation.toRotationMatrix();
  matrix.topRightCorner<3, 1>() = motion.translation;
  return matrix;
}

// Pixel centres are at .5, as in COLMAP.
Json IntrinsicsJson(const Camera& c) {
  return {{"w", c.width_px},
          {"h", c.height_px},
          {"fl_x", c.fx},
          {"fl_y", c.fy},
          {"cx", c.cx + kColmapPixelShift},
          {"cy", c.cy + kColmapPixelShift}};
}

// Nerfstudio's format: world_from_camera in OpenGL's axes (x right, y up, z back). If the focal
// length changes, every frame has its own intrinsics, and there are no shared ones, because
// Nerfstudio would prefer those.
Json TransformsJson(const Reconstruction& scene, const SceneFigures& figures) {
  const bool zooms = !scene.focal_scale.empty();
  Json frames = Json::array();
  for (const auto& [frame, cam_from_world] : scene.cam_from_world) {
    Eigen::Matrix4d world_from_camera = MatrixOf(cam_from_world.Inverse());
    world_from_camera.middleCols<2>(1) *= -1.0;
    frames.push_back({{"file_path", "images/" + ImageName(frame)},
                      {"transform_matrix", MatrixToJson(world_from_camera)},
                      {"colmap_im_id", ColmapImageIdOf(frame)}});
    if (figures.masked) frames.back()["mask_path"] = "masks/" + MaskName(frame);
    if (zooms) frames.back().update(IntrinsicsJson(CameraOf(scene, frame)));
  }
  Json json{{"camera_model", "PINHOLE"}};
  if (!zooms) json.update(IntrinsicsJson(scene.camera));
  json.update({{"k1", 0.0},
               {"k2", 0.0},
               {"p1", 0.0},
               {"p2", 0.0},
               {"ply_file_path", "sparse_pc.ply"},
               {"applied_transform",
                MatrixToJson(figures.scale * MatrixOf(figures.scene_from_model).topRows<3>())},
               {"frames", frames}});
  return json;
}

void WriteImages(const TrackFile& file,
                 const Reconstruction& model,
                 Sequence& sequence,
                 const SceneOptions& options,
                 const SceneFigures& figures,
                 const fs::path& folder,
                 const StageProgress& progress,
                 FurtherPoints* further) {  // may be null
  OutputFolder out(folder / "images", IsImageName);
  std::optional<OutputFolder> masks;
  if (figures.masked) masks.emplace(folder / "masks", IsMaskName);
  Undistorter undistorter;
  const cv::Mat table = figures.tone ? TableOf(*figures.tone) : cv::Mat();
  const std::set<FrameIndex> chosen(figures.images.begin(), figures.images.end());
  ForEachFrame(file, sequence, "write pictures", progress, [&](const Frame& frame) {
    if (!chosen.contains(frame.index)) return;
    const Camera from = CameraOf(model, frame.index);
    const Camera to = CameraOf(figures.camera, figures.focal_scale, frame.index);
    const cv::Mat bgr = BgrOf(frame);
    if (further != nullptr) further->Follow(frame, bgr);
    cv::Mat picture = undistorter.Undistort(bgr, from, to);
    if (!table.empty()) {
      cv::Mat bright;
      cv::LUT(picture, table, bright);
      picture = bright;
    }
    WriteImage(out.partial() / ImageName(frame.index),
               picture,
               {cv::IMWRITE_JPEG_QUALITY, options.jpeg_quality});
    if (!masks) return;
    // Nerfstudio wants a mask of all pictures or of none.
    const cv::Mat open(frame.gray.size(), CV_8UC1, cv::Scalar(255));
    WriteImage(
        masks->partial() / MaskName(frame.index),
        undistorter.Undistort(
            frame.mask.empty() ? open : cv::Mat(frame.mask != 0), from, to, cv::INTER_NEAREST));
  });
  out.Commit();
  if (masks) masks->Commit();
}

// Those of an earlier scene, which are not of these pictures.
void RemoveMasks(const fs::path& folder) {
  const fs::path masks = folder / "masks";
  if (!fs::exists(masks)) return;
  { const OutputFolder are_ours(masks, IsMaskName); }  // throws otherwise
  std::error_code ignored;
  fs::remove_all(masks, ignored);
}

}  // namespace

std::vector<FrameIndex> ChooseImages(const std::vector<SceneCandidate>& candidates,
                                     const SceneOptions& options) {
  if (candidates.empty()) return {};
  double path = 0.0;
  for (std::size_t i = 1; i < candidates.size(); ++i) path += candidates[i].motion;
  const auto most = static_cast<double>(
      std::min(candidates.size(), static_cast<std::size_t>(options.max_images)));
  // For a slow or short clip, similar pictures are better than few.
  constexpr double kFew = 50.0;
  const double pieces =
      options.min_motion > 0.0
          ? std::clamp(std::floor(path / options.min_motion), std::min(kFew, most), most)
          : most;
  // With as many pieces as frames, all frames are taken. If the camera stands still, the pieces are
  // equal in time.
  const bool by_time = path == 0.0 || pieces >= static_cast<double>(candidates.size());
  std::map<int, const SceneCandidate*> sharpest;
  double along = 0.0;
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    if (i > 0 && !by_time) along += candidates[i].motion / path;
    // In integers, because the rounding errors of a sum of thousands of small steps would miss the
    // edge of a piece.
    const int piece =
        by_time ? static_cast<int>(i * static_cast<std::size_t>(pieces) / candidates.size())
                : static_cast<int>(std::min(std::floor(along * pieces + 1e-9), pieces - 1.0));
    const auto [best, first] = sharpest.try_emplace(piece, &candidates[i]);
    if (!first && candidates[i].sharpness > best->second->sharpness) best->second = &candidates[i];
  }
  std::vector<FrameIndex> chosen;
  for (const auto& [piece, candidate] : sharpest) chosen.push_back(candidate->frame);
  return chosen;
}

Camera UndistortedCamera(const Camera& camera) {
  Camera pinhole;
  pinhole.width_px = camera.width_px;
  pinhole.height_px = camera.height_px;
  pinhole.cx = (camera.width_px - 1) / 2.0;
  pinhole.cy = (camera.height_px - 1) / 2.0;
  const double start = std::max(camera.fx, camera.fy);
  pinhole.fx = pinhole.fy = start;
  if (!camera.HasDistortion() && camera.fx == camera.fy && camera.cx == pinhole.cx &&
      camera.cy == pinhole.cy) {
    return pinhole;
  }
  // Points on the picture's border, some pixels apart.
  constexpr int kSteps = 64;
  std::vector<Eigen::Vector2d> border;
  for (int i = 0; i <= kSteps; ++i) {
    const double x = (camera.width_px - 1.0) * i / kSteps;
    const double y = (camera.height_px - 1.0) * i / kSteps;
    border.insert(border.end(),
                  {{x, 0.0}, {x, camera.height_px - 1.0}, {0.0, y}, {camera.width_px - 1.0, y}});
  }
  // Increases the view while the border is inside and moves outwards; beyond that the lens model
  // would fold.
  constexpr double kNarrowest = 4.0;
  constexpr double kWidest = 0.4;
  constexpr double kFiner = 0.998;
  const Eigen::Vector2d middle(camera.cx, camera.cy);
  std::vector<double> reached(border.size(), 0.0);
  double best = kNarrowest * start;
  for (double f = kNarrowest * start; f >= kWidest * start; f *= kFiner) {
    for (std::size_t i = 0; i < border.size(); ++i) {
      const auto xy =
          camera.Project({(border[i].x() - pinhole.cx) / f, (border[i].y() - pinhole.cy) / f, 1.0});
      constexpr double kRounding = 1e-6;
      if (!xy || !camera.Contains(*xy, -kRounding) || (*xy - middle).norm() < reached[i]) {
        pinhole.fx = pinhole.fy = best;
        return pinhole;
      }
      reached[i] = (*xy - middle).norm();
    }
    best = f;
  }
  pinhole.fx = pinhole.fy = best;
  return pinhole;
}

Rigid3 SceneFromModel(const Reconstruction& model) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
  for (const auto& [frame, cam_from_world] : model.cam_from_world) {
    up += cam_from_world.rotation.conjugate() * Eigen::Vector3d(0.0, -1.0, 0.0);
    center += cam_from_world.Inverse().translation;
  }
  const auto count = static_cast<double>(std::max<std::size_t>(model.cam_from_world.size(), 1));
  center /= count;
  // Below this the camera rolls through all directions, and there is no upward one.
  constexpr double kAgreed = 0.1;
  Rigid3 scene_from_model;
  if (up.norm() > kAgreed * count) {
    scene_from_model.rotation =
        Eigen::Quaterniond::FromTwoVectors(up.normalized(), Eigen::Vector3d::UnitZ());
  }
  scene_from_model.translation = -(scene_from_model.rotation * center);
  return scene_from_model;
}

void CheckSceneFolder(const fs::path& folder) {
  if (!fs::is_directory(folder)) return;
  const OutputFolder images(folder / "images", IsImageName);
  const OutputFolder masks(folder / "masks", IsMaskName);
  const OutputFolder sparse(folder / "sparse", {"0"});
  // Projects of COLMAP and Nerfstudio use the same names, so a folder without our own files is not
  // ours.
  const bool is_ours = fs::exists(folder / "clip.tracks") || fs::exists(folder / "model_of.json");
  std::vector<std::string> names(kSceneOutputs.begin(), kSceneOutputs.end());
  names.insert(names.end(), {"summary.json", "report.html"});
  for (const std::string& name : names) {
    if (fs::exists(folder / name) && !is_ours) {
      ThrowError("{} holds {}, which does not belong to a scene of cohort: give another folder",
                 folder.string(),
                 name);
    }
  }
}

void RemoveScene(const fs::path& folder) {
  CheckSceneFolder(folder);
  std::error_code ignored;
  for (const char* name : kSceneOutputs) {
    fs::remove_all(folder / name, ignored);
  }
}

std::vector<double> BrightnessOfFrames(const TrackFile& file,
                                       Sequence& sequence,
                                       const StageProgress& progress) {
  std::vector<double> brightness;
  ForEachFrame(file, sequence, "look", progress, [&](const Frame& frame) {
    brightness.push_back(BrightnessOf(BgrOf(frame)));
  });
  return brightness;
}

double ToneCurve::operator()(double value) const {
  return std::pow(std::clamp((value - black) / (white - black), 0.0, 1.0), gamma);
}

SceneFigures WriteScene(const TrackFile& file,
                        const Reconstruction& model,
                        Sequence& sequence,
                        const SceneOptions& options,
                        const fs::path& folder,
                        const StageProgress& progress) {
  if (model.cam_from_world.empty()) ThrowError("there is no model to make a scene from");
  const Survey survey = SurveyClip(file, model, sequence, progress);
  SceneFigures figures;
  figures.images = ChooseImages(survey.candidates, options);
  figures.camera = UndistortedCamera(model.camera);
  figures.focal_scale = UndistortedScales(model, figures.camera, figures.images);
  figures.scene_from_model = SceneFromModel(model);
  figures.scale = ScaleOf(model);
  figures.brightness = survey.brightness;
  if (options.brighten) figures.tone = Brighter(survey.histogram);
  figures.masked = std::ranges::any_of(
      figures.images, [&survey](FrameIndex frame) { return survey.masked.contains(frame); });

  std::optional<FurtherPoints> further;
  if (options.points > 0) {
    further.emplace(file, model, figures.images, static_cast<std::size_t>(options.points));
  }
  WriteImages(
      file, model, sequence, options, figures, folder, progress, further ? &*further : nullptr);
  std::map<FeatureId, Eigen::Vector3d> colours = MeanColours(survey);
  Reconstruction with_further = model;
  if (further) {
    for (auto& [feature, added] : further->Finish()) {
      colours[feature] = added.bgr;
      with_further.points[feature] = std::move(added.point);
    }
  }
  const Reconstruction scene = SceneModel(with_further, figures);
  figures.points = scene.points.size();
  figures.points_added = static_cast<std::size_t>(std::ranges::count_if(
      scene.points, [&model](const auto& point) { return !model.points.contains(point.first); }));
  ColmapModel written = ToColmapModel(scene);
  for (const auto& [feature, point] : scene.points) {
    written.points.at(std::uint64_t{ToInt(feature)} + 1).rgb =
        RgbOf(colours.at(feature), figures.tone);
  }
  if (!figures.masked) RemoveMasks(folder);
  OutputFolder sparse(folder / "sparse", {"0"});
  fs::create_directory(sparse.partial() / "0");
  WriteColmapModel(sparse.partial() / "0", written, ColmapModelFormat::kBinary);
  WriteColmapModel(sparse.partial() / "0", written, ColmapModelFormat::kText);
  sparse.Commit();
  OutputFile ply(folder / "sparse_pc.ply");
  WriteBytes(ply.partial(), PointsPly(written));
  ply.Commit();
  WriteJsonFile(folder / "transforms.json", TransformsJson(scene, figures));
  return figures;
}

}  // namespace cohort
