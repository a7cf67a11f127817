// What `cohort refine` makes of a COLMAP model, against the truth:
//   refine_benchmark --model SPARSE --images CLIP [--truth CLIP] [--intrinsics auto] > figures.json
// of three models: `before` as it came, `adjusted` by Ceres to the positions that it has,
// `refined`.
//   ate_share, points_cm      as `cohort evaluate`: cameras, and the median point
//   triangulated              points from the model's tracks and the true poses, as the benchmark of
//                             ETH3D and of featuremetric refinement has it: how many; accuracy, the
//                             share of them within 1, 2, 5 cm of the true surface; completeness, the
//                             share of the surface that has one of them so near
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "datasets/open_sequence.h"
#include "datasets/truth/track_truth.h"
#include "pipelines/evaluation/model_evaluation.h"
#include "pipelines/sfm/refine_model.h"
#include "pipelines/sfm/summary_json.h"

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;
constexpr std::array<double, 3> kThresholds{0.01, 0.02, 0.05};  // [m]

double DistanceToTriangle(const Eigen::Vector3d& p, const std::array<Eigen::Vector3d, 3>& t) {
  const auto to_segment = [&](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    const Eigen::Vector3d ab = b - a;
    const double share = std::clamp((p - a).dot(ab) / std::max(ab.squaredNorm(), 1e-18), 0.0, 1.0);
    return (p - a - share * ab).norm();
  };
  const Eigen::Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]);
  bool inside = normal.squaredNorm() > 1e-18;
  for (int i = 0; i < 3 && inside; ++i) {
    inside = (t[(i + 1) % 3] - t[i]).cross(p - t[i]).dot(normal) >= 0.0;
  }
  if (inside) return std::abs((p - t[0]).dot(normal)) / normal.norm();
  return std::min({to_segment(t[0], t[1]), to_segment(t[1], t[2]), to_segment(t[2], t[0])});
}

// Distance [m] of a point to the surface as a frame shows it about the point's picture; none where
// it shows none. Good to 5 cm: further is further.
std::optional<double> DistanceToSurface(TrackTruth& truth,
                                        const Camera& camera,
                                        FrameIndex frame,
                                        const Rigid3& cam_from_world,
                                        const Eigen::Vector3d& point) {
  constexpr int kSteps = 8;
  constexpr double kJump = 0.1;  // of the depth: no surface between
  const Eigen::Vector3d in_cam = cam_from_world * point;
  const auto xy = camera.Project(in_cam);
  if (!xy) return std::nullopt;
  const double step = std::max(1.5 * kThresholds.back() * camera.fx / in_cam.z(), 2.0) / kSteps;
  std::map<std::pair<int, int>, Eigen::Vector3d> surface;
  for (int i = -kSteps; i <= kSteps; ++i) {
    for (int j = -kSteps; j <= kSteps; ++j) {
      const Eigen::Vector2d at = *xy + step * Eigen::Vector2d(i, j);
      if (!camera.Contains(at)) continue;
      if (const auto anchor = truth.Pick(frame, at)) surface[{i, j}] = anchor->x_in_world;
    }
  }
  std::optional<double> nearest;
  const auto triangle = [&](std::array<std::pair<int, int>, 3> corners) {
    std::array<Eigen::Vector3d, 3> t;
    for (int i = 0; i < 3; ++i) {
      const auto corner = surface.find(corners[i]);
      if (corner == surface.end()) return;
      t[i] = corner->second;
    }
    for (int i = 0; i < 3; ++i) {
      if ((t[i] - t[(i + 1) % 3]).norm() > kJump * in_cam.z()) return;
    }
    const double distance = DistanceToTriangle(point, t);
    if (!nearest || distance < *nearest) nearest = distance;
  };
  for (int i = -kSteps; i < kSteps; ++i) {
    for (int j = -kSteps; j < kSteps; ++j) {
      triangle({{{i, j}, {i + 1, j}, {i, j + 1}}});
      triangle({{{i + 1, j + 1}, {i + 1, j}, {i, j + 1}}});
    }
  }
  return nearest;
}

// Points in cells of a size, to find those near another one.
class Cells {
 public:
  Cells(const std::vector<Eigen::Vector3d>& points, double size) : size_(size) {
    for (const Eigen::Vector3d& p : points) cells_[CellOf(p)].push_back(p);
  }
  bool HasWithin(const Eigen::Vector3d& p) const {
    const auto [x, y, z] = CellOf(p);
    for (int i = -1; i <= 1; ++i) {
      for (int j = -1; j <= 1; ++j) {
        for (int k = -1; k <= 1; ++k) {
          const auto cell = cells_.find({x + i, y + j, z + k});
          if (cell == cells_.end()) continue;
          for (const Eigen::Vector3d& q : cell->second) {
            if ((p - q).norm() <= size_) return true;
          }
        }
      }
    }
    return false;
  }

 private:
  std::array<int, 3> CellOf(const Eigen::Vector3d& p) const {
    return {static_cast<int>(std::floor(p.x() / size_)),
            static_cast<int>(std::floor(p.y() / size_)),
            static_cast<int>(std::floor(p.z() / size_))};
  }
  double size_;
  std::map<std::array<int, 3>, std::vector<Eigen::Vector3d>> cells_;
};

std::vector<Eigen::Vector3d> SampleSurface(TrackTruth& truth,
                                           const Camera& camera,
                                           const std::map<FrameIndex, Rigid3>& poses) {
  constexpr int kEveryPx = 8;
  constexpr int kEveryFrame = 10;
  std::vector<Eigen::Vector3d> samples;
  int frame = 0;
  for (const auto& [index, pose] : poses) {
    if (frame++ % kEveryFrame != 0) continue;
    for (int y = 0; y < camera.height_px; y += kEveryPx) {
      for (int x = 0; x < camera.width_px; x += kEveryPx) {
        const auto anchor = truth.Pick(index, Eigen::Vector2d(x, y));
        if (anchor) samples.push_back(anchor->x_in_world);
      }
    }
  }
  return samples;
}

struct Truth {
  std::unique_ptr<Sequence> sequence;
  std::unique_ptr<TrackTruth> tracks;  // none without depth
  Camera camera;
  std::map<FrameIndex, Rigid3> cam_from_world;  // of the model's frames
  std::vector<Eigen::Vector3d> surface;
};

Json Triangulated(TrackFile file, const Reconstruction& of, Truth& truth) {
  file.camera = truth.camera;
  file.tracks = file.tracks.Select([&](FeatureId feature) { return of.points.contains(feature); });
  const Reconstruction model = TriangulateWithCeres(file, truth.cam_from_world).reconstruction;
  std::array<std::size_t, kThresholds.size()> accurate{};
  std::size_t judged = 0;
  std::vector<Eigen::Vector3d> points;
  for (const auto& [feature, point] : model.points) {
    points.push_back(point.in_world);
    const PointView& view = point.views[point.views.size() / 2];
    const auto distance = DistanceToSurface(*truth.tracks,
                                            truth.camera,
                                            view.frame,
                                            truth.cam_from_world.at(view.frame),
                                            point.in_world);
    ++judged;
    for (std::size_t i = 0; i < kThresholds.size(); ++i) {
      if (distance && *distance <= kThresholds[i]) ++accurate[i];
    }
  }
  Json json{{"points", points.size()}};
  for (std::size_t i = 0; i < kThresholds.size(); ++i) {
    json["accuracy"].push_back(static_cast<double>(accurate[i]) / static_cast<double>(judged));
    const Cells cells(points, kThresholds[i]);
    const auto covered = std::count_if(truth.surface.begin(),
                                       truth.surface.end(),
                                       [&](const auto& p) { return cells.HasWithin(p); });
    json["completeness"].push_back(static_cast<double>(covered) /
                                   static_cast<double>(truth.surface.size()));
  }
  return json;
}

Json Figures(const Reconstruction& model,
             const TrackFile& file,
             const std::vector<FrameIndex>& frames,
             Truth& truth) {
  ModelTruth model_truth;
  model_truth.cam_from_world = truth.cam_from_world;
  if (truth.tracks) {
    model_truth.point = [&](FrameIndex frame,
                            const Eigen::Vector2d& xy) -> std::optional<Eigen::Vector3d> {
      const auto anchor = truth.tracks->Pick(frame, xy);
      if (!anchor) return std::nullopt;
      return anchor->x_in_world;
    };
  }
  const ModelEvaluation e = EvaluateModel(model, frames, model_truth);
  Json json{{"registered", e.registered},
            {"points", model.points.size()},
            {"focal_px", model.camera.fx},
            {"ate_share", e.ate_share.value_or(NAN)}};
  if (truth.tracks) {
    json["points_cm"] = 100.0 * e.point_error_median_m.value_or(NAN);
    json["triangulated"] = Triangulated(file, model, truth);
  }
  return json;
}

void Run(const std::string& model_folder,
         const std::string& images,
         const std::string& truth_folder,
         const std::string& intrinsics) {
  const auto sequence = OpenSequence(images);
  const ColmapModel model = ReadColmapModel(model_folder);
  RefineModelOptions options;
  options.ceres.covariances = false;
  for (const auto& [name, mode] : kIntrinsicsModeNames) {
    if (name == intrinsics) options.intrinsics = mode;
  }
  const RefinedModel refined = RefineModel(model, model_folder, *sequence, options);
  const ModelOfClip clip = ReadModelOfClip(model, refined.file.frames, model_folder);
  Reconstruction start = clip.reconstruction;
  start.camera.known = !refined.camera_refined;
  const Reconstruction adjusted = AdjustAndJudgeWithCeres(clip.file, start).reconstruction;

  Truth truth;
  truth.sequence = OpenSequence(truth_folder);
  truth.tracks = OpenTrackTruth(*truth.sequence, truth_folder);
  std::vector<FrameIndex> frames;
  for (const FrameInfo& frame : clip.file.frames) frames.push_back(frame.index);
  for (const auto& [frame, pose] : truth.sequence->TrueCamFromWorld()) {
    if (std::binary_search(frames.begin(), frames.end(), frame)) truth.cam_from_world[frame] = pose;
  }
  truth.camera = truth.sequence->KnownCamera().value_or(clip.reconstruction.camera);
  truth.camera.width_px = clip.file.width_px;
  truth.camera.height_px = clip.file.height_px;
  if (truth.tracks) {
    truth.surface = SampleSurface(*truth.tracks, truth.camera, truth.cam_from_world);
  }
  const Json json{
      {"before", Figures(clip.reconstruction, clip.file, frames, truth)},
      {"adjusted", Figures(adjusted, clip.file, frames, truth)},
      {"refined", Figures(refined.adjusted.reconstruction, refined.file, frames, truth)},
      {"found", refined.found.replaced},
      {"not_found", refined.found.left},
      {"camera_refined", refined.camera_refined},
      {"reasons", DoubtsToJson(refined.adjusted.summary.reasons)}};
  fmt::print("{}\n", json.dump(2));
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  CLI::App app{"What refine makes of a COLMAP model"};
  std::string model;
  std::string images;
  std::string truth;
  std::string intrinsics = "auto";
  app.add_option("--model", model)->required();
  app.add_option("--images", images)->required();
  app.add_option("--truth", truth, "the clip with true cameras, if it is another")->required();
  app.add_option("--intrinsics", intrinsics)->check(CLI::IsMember({"auto", "keep", "refine"}));
  CLI11_PARSE(app, argc, argv);
  try {
    cohort::Run(model, images, truth, intrinsics);
  } catch (const std::exception& error) {
    fmt::print(stderr, "refine_benchmark: {}\n", error.what());
    return 1;
  }
}
