#include "pipelines/report/clip_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "datasets/readers/text_table.h"
#include "frontend/core/statistics.h"
#include "frontend/storage/output.h"
#include "pipelines/json/json_file.h"
#include "pipelines/report/brightening.h"
#include "pipelines/report/report_page.h"
#include "pipelines/report/shown_models.h"
#include "pipelines/report/track_picture.h"
#include "pipelines/sfm/for_each_frame.h"
#include "pipelines/sfm/reconstruct.h"
#include "pipelines/sfm/summary_json.h"
#include "pipelines/sfm/version.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMostFrames = 150;
constexpr std::size_t kMostTracks = 300;    // and in addition, in every shown frame
constexpr std::size_t kFewestInFrame = 60;  // at least this many of the longest
constexpr std::size_t kMostPoints = 20000;
constexpr int kPictureWidthPx = 320;
constexpr int kMostPictureHeightPx = 1280;  // for pictures more than four times as high as wide
constexpr int kPictureQuality = 60;
constexpr double kUnitsPerPx = 4.0;  // units of positions in the page per pixel of its pictures

// The 3 x 3 blocks from (first, first) on of upper triangles of `size` rows, by id.
std::map<std::uint32_t, Eigen::Matrix3d> ReadBlocks(const fs::path& path, int size, int first) {
  std::map<std::uint32_t, Eigen::Matrix3d> blocks;
  if (!fs::exists(path)) return blocks;
  const TextTable table(path);
  for (std::size_t row = 1; row < table.rows(); ++row) {
    Eigen::Matrix3d block;
    std::size_t column = 1;
    for (int i = 0; i < size; ++i) {
      for (int j = i; j < size; ++j, ++column) {
        if (i < first || j >= first + 3) continue;
        block(i - first, j - first) = block(j - first, i - first) = table.Number(row, column);
      }
    }
    blocks[static_cast<std::uint32_t>(table.Integer(row, 0))] = block;
  }
  return blocks;
}

template <typename Id>
std::map<Id, Eigen::Matrix3d> ById(const std::map<std::uint32_t, Eigen::Matrix3d>& blocks) {
  std::map<Id, Eigen::Matrix3d> by_id;
  for (const auto& [id, block] : blocks) by_id.emplace(Id{id}, block);
  return by_id;
}

// To five digits, which suffice for a page.
double Rounded(double value) {
  // Not stod, which rejects denormals.
  return std::strtod(fmt::format("{:.5g}", value).c_str(), nullptr);
}

void Append(const Eigen::Vector3d& xyz, Json& flat) {
  for (const double value : xyz) flat.push_back(Rounded(value));
}

// The upper triangle; null without a covariance.
template <typename Id>
Json TriangleOf(const std::map<Id, Eigen::Matrix3d>& covariances, Id id) {
  const auto found = covariances.find(id);
  if (found == covariances.end()) return nullptr;
  const Eigen::Matrix3d& c = found->second;
  return {Rounded(c(0, 0)),
          Rounded(c(0, 1)),
          Rounded(c(0, 2)),
          Rounded(c(1, 1)),
          Rounded(c(1, 2)),
          Rounded(c(2, 2))};
}

// The n for which showing every n-th frame gives few enough frames.
std::size_t FramesAStep(const TrackFile& file) {
  return std::max<std::size_t>(1, (file.frames.size() + kMostFrames - 1) / kMostFrames);
}

std::vector<FrameInfo> ShownFrames(const TrackFile& file) {
  const std::size_t every = FramesAStep(file);
  std::vector<FrameInfo> shown;
  for (std::size_t i = 0; i < file.frames.size(); i += every) shown.push_back(file.frames[i]);
  return shown;
}

// The longest tracks, which show the most, and some tracks of every frame.
std::set<FeatureId> ShownTracks(const TrackSet& tracks, const std::vector<FrameInfo>& frames) {
  const auto length = [&](FeatureId feature) { return tracks.Track(feature).size(); };
  const auto longest = [&](std::vector<FeatureId> features, std::size_t most) {
    std::stable_sort(features.begin(), features.end(), [&](FeatureId a, FeatureId b) {
      return length(a) > length(b);
    });
    features.resize(std::min(features.size(), most));
    return features;
  };
  const auto all = longest({tracks.features().begin(), tracks.features().end()}, kMostTracks);
  std::set<FeatureId> shown(all.begin(), all.end());
  for (const FrameInfo& frame : frames) {
    std::vector<FeatureId> alive;
    for (const Observation* o : tracks.InFrame(frame.index)) alive.push_back(o->feature);
    const auto some = longest(std::move(alive), kFewestInFrame);
    shown.insert(some.begin(), some.end());
  }
  return shown;
}

// The id, x, y and observed of every shown track in a frame, as a flat list.
Json PositionsIn(const TrackSet& tracks,
                 FrameIndex frame,
                 const std::set<FeatureId>& shown,
                 double scale) {
  Json flat = Json::array();
  for (const Observation* o : tracks.InFrame(frame)) {
    if (!shown.contains(o->feature)) continue;
    flat.push_back(ToInt(o->feature));
    flat.push_back(std::lround(kUnitsPerPx * scale * o->xy.x()));
    flat.push_back(std::lround(kUnitsPerPx * scale * o->xy.y()));
    flat.push_back(IsObserved(*o) ? 1 : 0);
  }
  return flat;
}

// Mean colours of points, from the shown frames.
class PointColours {
 public:
  explicit PointColours(const Reconstruction& model) {
    for (const auto& [feature, point] : model.points) {
      for (const PointView& view : point.views) views_[view.frame].emplace_back(feature, view.xy);
    }
  }

  void See(const Frame& frame) {
    const auto seen = views_.find(frame.index);
    if (seen == views_.end()) return;
    cv::Mat picture = frame.color.empty() ? frame.gray : frame.color;
    if (picture.depth() == CV_16U) picture.convertTo(picture, CV_8U, 1.0 / 257.0);
    const int channels = picture.channels();
    for (const auto& [feature, xy] : seen->second) {
      const int x = std::clamp(static_cast<int>(std::lround(xy.x())), 0, picture.cols - 1);
      const int y = std::clamp(static_cast<int>(std::lround(xy.y())), 0, picture.rows - 1);
      const std::uint8_t* pixel = picture.ptr<std::uint8_t>(y) + channels * x;
      Sum& sum = sums_[feature];
      for (int c = 0; c < 3; ++c) sum.rgb[c] += pixel[channels >= 3 ? 2 - c : 0];
      ++sum.count;
    }
  }

  // nullopt for a point that no shown frame has.
  std::optional<Eigen::Vector3d> Of(FeatureId feature) const {
    const auto sum = sums_.find(feature);
    if (sum == sums_.end()) return std::nullopt;
    return sum->second.rgb / sum->second.count;
  }

 private:
  struct Sum {
    Eigen::Vector3d rgb = Eigen::Vector3d::Zero();
    double count = 0.0;
  };
  std::map<FrameIndex, std::vector<std::pair<FeatureId, Eigen::Vector2d>>> views_;
  std::map<FeatureId, Sum> sums_;
};

Json CamerasOf(const ClipReport& report, const Eigen::Vector3d& middle) {
  Json cameras = Json::array();
  for (const auto& [frame, cam_from_world] : report.model.cam_from_world) {
    const Camera c = CameraOf(report.model, frame);
    const Rigid3 world_from_cam = cam_from_world.Inverse();
    Json camera{{"frame", ToInt(frame)}, {"center", Json::array()}, {"corners", Json::array()}};
    Append(world_from_cam.translation - middle, camera["center"]);
    for (const auto& [x, y] : {std::pair{0.0, 0.0},
                               {c.width_px - 1.0, 0.0},
                               {c.width_px - 1.0, c.height_px - 1.0},
                               {0.0, c.height_px - 1.0}}) {
      Eigen::Vector3d ray = c.Unproject({x, y}).homogeneous();  // from the centre, at depth 1
      constexpr double kLongest = 2.0;  // longer ones, as of a fisheye, would fill the view
      if (ray.norm() > kLongest) ray *= kLongest / ray.norm();
      Append(world_from_cam.rotation * ray, camera["corners"]);
    }
    camera["covariance"] = TriangleOf(report.camera_covariances, frame);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

Json PointsOf(const ClipReport& report,
              const PointColours& colours,
              const Eigen::Vector3d& middle) {
  Json points{{"xyz", Json::array()}, {"rgb", Json::array()}, {"covariances", Json::array()}};
  const std::size_t every =
      std::max<std::size_t>(1, (report.model.points.size() + kMostPoints - 1) / kMostPoints);
  std::size_t i = 0;
  for (const auto& [feature, point] : report.model.points) {
    if (i++ % every != 0) continue;
    Append(point.in_world - middle, points["xyz"]);
    const std::optional<Eigen::Vector3d> rgb = colours.Of(feature);
    for (int c = 0; c < 3; ++c) {
      points["rgb"].push_back(rgb ? Json(std::lround((*rgb)[c])) : Json());
    }
    points["covariances"].push_back(TriangleOf(report.point_covariances, feature));
  }
  return points;
}

// Median displacement of the features observed in both frames [px]; null without any.
Json MotionBetween(const TrackSet& tracks, FrameIndex from, FrameIndex to) {
  std::vector<double> motions = tracks.MotionsPx(from, to);
  return motions.empty() ? Json() : Json(Rounded(InterpolatedMedian(std::move(motions))));
}

// The camera's displacement, in per cent of the distance to the scene; null without both poses.
Json WayBetween(const Reconstruction& model, double distance, FrameIndex from, FrameIndex to) {
  const auto a = model.cam_from_world.find(from);
  const auto b = model.cam_from_world.find(to);
  if (a == model.cam_from_world.end() || b == model.cam_from_world.end() || distance <= 0.0) {
    return {};
  }
  const double way = (b->second.Inverse().translation - a->second.Inverse().translation).norm();
  return Rounded(100.0 * way / distance);
}

// The values of all frames that the page plots.
Json PerFrame(const TrackFile& file, const Reconstruction& model) {
  Json columns;
  for (const char* name :
       {"frame", "observed", "predicted", "motion_px", "way_percent", "residual_px"}) {
    columns[name] = Json::array();
  }
  const double distance = MedianDistance(model);
  std::map<FrameIndex, std::vector<double>> errors = ReprojectionErrors(model);
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const FrameIndex frame = file.frames[i].index;
    const std::size_t observed = file.tracks.CountObserved(frame);
    columns["frame"].push_back(ToInt(frame));
    columns["observed"].push_back(observed);
    columns["predicted"].push_back(file.tracks.InFrame(frame).size() - observed);
    const bool first = i == 0;
    const FrameIndex before = file.frames[first ? 0 : i - 1].index;
    columns["motion_px"].push_back(first ? Json() : MotionBetween(file.tracks, before, frame));
    columns["way_percent"].push_back(first ? Json() : WayBetween(model, distance, before, frame));
    std::vector<double>& of_frame = errors[frame];
    columns["residual_px"].push_back(
        of_frame.empty() ? Json() : Json(Rounded(InterpolatedMedian(of_frame))));
  }
  return columns;
}

}  // namespace

ClipReport ReadClipReport(const fs::path& model_folder) {
  ClipReport report;
  report.title = model_folder.filename().string();
  if (!fs::exists(model_folder / "summary.json")) {
    ThrowError("{}: give a model folder of `cohort reconstruct`: it has no summary.json",
               model_folder.string());
  }
  UseJsonFile(model_folder / "summary.json", [&](const Json& summary) {
    if (summary.at("registered") != 0 && !fs::exists(model_folder / "images.bin")) {
      ThrowError(
          "{}: it has no images.bin: give a model folder; in a scene of `cohort sfm` that is {}",
          model_folder.string(),
          (model_folder / "model").string());
    }
    report.facts = {
        {"frames with a pose",
         fmt::format(
             "{} of {}",
             CountAt(summary, "registered"),
             CountAt(summary, summary.contains("scene_frames") ? "scene_frames" : "frames"))},
        {"points", fmt::format("{}", CountAt(summary, "points"))}};
    if (summary.contains("quality") && summary["quality"].is_string()) {
      report.facts.emplace_back("quality", summary["quality"].get<std::string>());
    }
    if (summary.contains("expected_error") && summary["expected_error"].is_number()) {
      report.facts.emplace_back(
          "expected error of the cameras, of the extent of their path",
          fmt::format("{:.2g} %", 100.0 * summary["expected_error"].get<double>()));
    }
    if (summary.contains("reasons")) {
      report.sentences = SentencesOf(DoubtsFromJson(summary["reasons"]));
    }
    if (summary.at("registered") == 0) {
      report.sentences.push_back("There is no model: " +
                                 summary.at("termination").get<std::string>());
    }
  });
  if (fs::exists(model_folder / "images.bin")) report.model = ReadModelFolder(model_folder);
  report.camera_covariances =
      ById<FrameIndex>(ReadBlocks(model_folder / "camera_covariances.csv", 6, 3));
  report.point_covariances =
      ById<FeatureId>(ReadBlocks(model_folder / "point_covariances.csv", 3, 0));
  return report;
}

void WriteClipReport(const fs::path& path,
                     const ClipReport& report,
                     const TrackFile& file,
                     Sequence& sequence,
                     const StageProgress& progress) {
  const std::vector<FrameInfo> shown = ShownFrames(file);
  const std::set<FeatureId> features = ShownTracks(file.tracks, shown);
  PointColours colours(report.model);
  std::vector<cv::Mat> pictures;  // CV_32FC1
  std::vector<IntensityRange> ranges;
  const double scale = std::min({1.0,
                                 static_cast<double>(kPictureWidthPx) / file.width_px,
                                 static_cast<double>(kMostPictureHeightPx) / file.height_px});
  const cv::Size size(std::max(1, static_cast<int>(std::lround(scale * file.width_px))),
                      std::max(1, static_cast<int>(std::lround(scale * file.height_px))));
  ForEachFrame(file, shown, sequence, "report", progress, [&](const Frame& frame) {
    colours.See(frame);
    cv::Mat picture;
    frame.gray.convertTo(picture, CV_32F);
    cv::resize(picture, picture, size, 0.0, 0.0, cv::INTER_AREA);
    ranges.push_back(IntensityRangeOf(picture));
    pictures.push_back(std::move(picture));
  });
  ranges = Steadied(ranges, kSteadyFrames / static_cast<double>(FramesAStep(file)));
  Json frames = Json::array();
  for (std::size_t i = 0; i < shown.size(); ++i) {
    frames.push_back({{"frame", ToInt(shown[i].index)},
                      {"name", shown[i].name},
                      {"picture", JpegDataUri(Brightened(pictures[i], ranges[i]), kPictureQuality)},
                      {"positions", PositionsIn(file.tracks, shown[i].index, features, scale)}});
  }
  const Eigen::Vector3d middle = MiddleOfCameras(report.model.cam_from_world);
  Json facts = Json::array();
  for (const auto& [name, value] : report.facts) facts.push_back({name, value});
  WritePage(path,
            kClipPage,
            {{"program", fmt::format("cohort {}", kVersion)},
             {"title", report.title},
             {"facts", facts},
             {"sentences", report.sentences},
             {"units_per_px", kUnitsPerPx},
             {"frames", frames},
             {"tracks", {{"all", file.tracks.features().size()}, {"shown", features.size()}}},
             {"per_frame", PerFrame(file, report.model)},
             {"cameras", CamerasOf(report, middle)},
             {"points", PointsOf(report, colours, middle)},
             {"points_in_all", report.model.points.size()}});
}

}  // namespace cohort
