// The points of a scene of `cohort sfm` against the truth, those of the tracks and those added to
// them (--points):
//   further_points_benchmark --scene SCENE --truth CLIP [--picture F.jpg]
// prints the number of each and the median and the upper decile of their errors [cm] after the
// alignment of the cameras. A point's truth is the surface in its first view, as for `cohort
// evaluate`. The picture has the points before the camera of the scene's middle picture: left those
// of the tracks, right all.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "backend/colmap/model_io.h"
#include "datasets/open_sequence.h"
#include "datasets/truth/track_truth.h"
#include "frontend/core/statistics.h"
#include "frontend/image/write_image.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/evaluation/alignment.h"

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;

Sim3 TruthFromScene(const Reconstruction& scene, const std::map<FrameIndex, Rigid3>& truth) {
  std::vector<Eigen::Vector3d> ours;
  std::vector<Eigen::Vector3d> real;
  for (const auto& [frame, pose] : scene.cam_from_world) {
    const auto it = truth.find(frame);
    if (it == truth.end()) continue;
    ours.push_back(pose.Inverse().translation);
    real.push_back(it->second.Inverse().translation);
  }
  const auto alignment = AlignPoints(ours, real, AlignmentScale::kEstimated);
  if (!alignment) ThrowError("the true cameras do not fix the alignment of the scene");
  return *alignment;
}

Json ErrorsToJson(const std::vector<double>& errors, std::size_t points) {
  return {{"points", points},
          {"with_truth", errors.size()},
          {"median_cm", 100.0 * InterpolatedMedian(errors)},
          {"p90_cm", 100.0 * InterpolatedQuantile(errors, 0.9)}};
}

// The points of ids up to `last`, the nearest on top.
cv::Mat PictureOf(const Reconstruction& scene,
                  const ColmapModel& colours,
                  FrameIndex frame,
                  FeatureId last) {
  const Camera camera = CameraOf(scene, frame);
  struct Dot {
    double depth;
    cv::Point at;
    cv::Scalar bgr;
  };
  std::vector<Dot> dots;
  for (const auto& [feature, point] : scene.points) {
    if (feature > last) break;
    const Eigen::Vector3d x = scene.cam_from_world.at(frame) * point.in_world;
    const auto xy = camera.Project(x);
    if (!xy || !camera.Contains(*xy)) continue;
    const auto& rgb = colours.points.at(std::uint64_t{ToInt(feature)} + 1).rgb;
    dots.push_back(
        {x.z(), {cvRound(xy->x()), cvRound(xy->y())}, {1.0 * rgb[2], 1.0 * rgb[1], 1.0 * rgb[0]}});
  }
  std::ranges::stable_sort(dots, std::greater<>(), &Dot::depth);
  cv::Mat picture(camera.height_px, camera.width_px, CV_8UC3, cv::Scalar(40, 25, 15));
  for (const Dot& dot : dots) cv::circle(picture, dot.at, 2, dot.bgr, cv::FILLED, cv::LINE_AA);
  return picture;
}

void WritePicture(const std::string& path,
                  const Reconstruction& scene,
                  const ColmapModel& colours,
                  FeatureId last_tracked) {
  auto middle = scene.cam_from_world.begin();
  std::advance(middle, scene.cam_from_world.size() / 2);
  const cv::Mat before = PictureOf(scene, colours, middle->first, last_tracked);
  const cv::Mat after = PictureOf(scene, colours, middle->first, scene.points.rbegin()->first);
  cv::Mat both;
  cv::hconcat(before, after, both);
  WriteImage(path, both, {cv::IMWRITE_JPEG_QUALITY, 80});
}

int Run(const std::string& folder, const std::string& truth_input, const std::string& picture) {
  const ColmapModel model = ReadColmapModel(folder + "/sparse/0");
  const Reconstruction scene = FromColmapModel(model);
  const TrackFile file = ReadTrackFile(folder + "/clip.tracks");
  const FeatureId last_tracked =
      *std::max_element(file.tracks.features().begin(), file.tracks.features().end());
  const auto sequence = OpenSequence(truth_input);
  const auto truth = OpenTrackTruth(*sequence, truth_input);
  if (truth == nullptr || !sequence->KnownCamera()) ThrowError("{} has no truth", truth_input);
  const Camera camera = *sequence->KnownCamera();
  const Sim3 truth_from_scene = TruthFromScene(scene, sequence->TrueCamFromWorld());
  std::vector<double> tracked;
  std::vector<double> added;
  std::size_t count = 0;
  for (const auto& [feature, point] : scene.points) {
    const bool is_added = feature > last_tracked;
    count += is_added ? 1 : 0;
    const PointView& first = point.views.front();
    const auto xy =
        camera.Project(CameraOf(scene, first.frame).Unproject(first.xy).homogeneous().eval());
    const auto anchor = xy ? truth->Pick(first.frame, *xy) : std::nullopt;
    if (!anchor) continue;
    const double error = (truth_from_scene * point.in_world - anchor->x_in_world).norm();
    (is_added ? added : tracked).push_back(error);
  }
  const Json json{{"tracked", ErrorsToJson(tracked, scene.points.size() - count)},
                  {"added", ErrorsToJson(added, count)},
                  {"ratio", InterpolatedMedian(added) / InterpolatedMedian(tracked)}};
  fmt::print("{}\n", json.dump());
  if (!picture.empty()) WritePicture(picture, scene, model, last_tracked);
  return 0;
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) try {
  CLI::App app("The points of a scene against the truth");
  std::string scene;
  std::string truth;
  std::string picture;
  app.add_option("--scene", scene)->required();
  app.add_option("--truth", truth)->required();
  app.add_option("--picture", picture);
  CLI11_PARSE(app, argc, argv);
  return cohort::Run(scene, truth, picture);
} catch (const std::exception& error) {
  fmt::print(stderr, "{}\n", error.what());
  return 1;
}
