#include "pipelines/report/shown_models.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "backend/colmap/model_io.h"
#include "datasets/truth/track_truth.h"
#include "frontend/core/statistics.h"
#include "pipelines/evaluation/alignment.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

double RoundedShown(double value) { return std::round(value * 1e4) / 1e4; }

void AppendShown(const Eigen::Vector3d& x, Json& list) {
  for (const double value : {x.x(), x.y(), x.z()}) list.push_back(RoundedShown(value));
}

// The world of the shown models.
struct ShownWorld {
  std::map<FrameIndex, Rigid3> cam_from_world;  // empty: there is none
  Eigen::Vector3d middle;
  Eigen::Vector3d up = -Eigen::Vector3d::UnitY();  // mean over the cameras

  explicit ShownWorld(std::map<FrameIndex, Rigid3> poses)
      : cam_from_world(std::move(poses)), middle(MiddleOfCameras(cam_from_world)) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for (const auto& [frame, pose] : cam_from_world) {
      sum -= pose.Inverse().rotation * Eigen::Vector3d::UnitY();
    }
    if (sum.norm() > 1e-6) up = sum.normalized();
  }
};

Json PathOf(const std::map<FrameIndex, Rigid3>& cam_from_world,
            const Sim3& shown_from_world,
            const ShownWorld& world) {
  Json path = Json::array();
  for (const auto& [frame, pose] : cam_from_world) {
    AppendShown(shown_from_world * pose.Inverse().translation - world.middle, path);
  }
  return path;
}

// The class of a point's error, as a share of its distance from the camera that saw it first: 0 up
// to 1 %, 1 up to 5 %, 2 beyond, 3 if the truth is unknown.
int ErrorClassOf(const Point3D& point,
                 const Sim3& truth_from_world,
                 const std::map<FrameIndex, Rigid3>& true_poses,
                 TrackTruth* truth) {
  if (truth == nullptr || point.views.empty()) return 3;
  const PointView& first = point.views.front();
  const auto pose = true_poses.find(first.frame);
  const auto anchor = truth->Pick(first.frame, first.xy);
  if (!anchor || pose == true_poses.end()) return 3;
  const double error = (truth_from_world * point.in_world - anchor->x_in_world).norm();
  const double distance = (pose->second * anchor->x_in_world).norm();
  return error <= 0.01 * distance ? 0 : error <= 0.05 * distance ? 1 : 2;
}

struct ShownPoints {
  Json xyz = Json::array();
  Json error_classes = Json::array();
};

// Every n-th point, without the 2 % that are farthest from the cameras, which would shrink the rest
// of the view.
ShownPoints PointsOf(const Reconstruction& model,
                     const Sim3& shown_from_world,
                     const ShownWorld& world,
                     const std::map<FrameIndex, Rigid3>& true_poses,
                     TrackTruth* truth) {
  constexpr std::size_t kMostPoints = 4000;
  const Eigen::Vector3d middle = MiddleOfCameras(model.cam_from_world);
  std::vector<double> distances;
  for (const auto& [feature, point] : model.points) {
    distances.push_back((point.in_world - middle).norm());
  }
  const double limit = 1.5 * Quantile(distances, 0.98);
  const std::size_t step = 1 + model.points.size() / kMostPoints;
  ShownPoints points;
  std::size_t i = 0;
  for (const auto& [feature, point] : model.points) {
    if (i++ % step != 0 || (point.in_world - middle).norm() > limit) continue;
    AppendShown(shown_from_world * point.in_world - world.middle, points.xyz);
    points.error_classes.push_back(ErrorClassOf(point, shown_from_world, true_poses, truth));
  }
  return points;
}

std::optional<Sim3> AlignmentWith(const std::map<FrameIndex, Rigid3>& truth,
                                  const Reconstruction& model) {
  std::vector<Eigen::Vector3d> estimated;
  std::vector<Eigen::Vector3d> real;
  for (const auto& [frame, pose] : model.cam_from_world) {
    const auto it = truth.find(frame);
    if (it == truth.end()) continue;
    estimated.push_back(pose.Inverse().translation);
    real.push_back(it->second.Inverse().translation);
  }
  return AlignPoints(estimated, real, AlignmentScale::kEstimated);
}

bool HasShownModel(const TrackCell& cell, GridBackend backend) {
  return cell.IsModelled(backend) && fs::exists(cell.Model(backend) / "images.bin");
}

// A tracker's reconstruction in the shown world.
Json ModelOf(const TrackCell& cell,
             GridBackend backend,
             const ShownWorld& world,
             const std::map<FrameIndex, Rigid3>& truth,
             TrackTruth* point_truth) {
  Json json{{"tracker", cell.tracker.name}};
  if (!HasShownModel(cell, backend)) {
    json["failed"] = true;
    return json;
  }
  const Reconstruction model = ReadReconstruction(cell.Model(backend));
  const Sim3 shown_from_world = AlignmentWith(world.cam_from_world, model).value_or(Sim3{});
  json["path"] = PathOf(model.cam_from_world, shown_from_world, world);
  ShownPoints points = PointsOf(model, shown_from_world, world, truth, point_truth);
  json["points"] = std::move(points.xyz);
  json["error_classes"] = std::move(points.error_classes);
  return json;
}

// The world of the truth or, without it, of the first model.
ShownWorld WorldOf(const std::map<FrameIndex, Rigid3>& truth,
                   const std::vector<const TrackCell*>& pair,
                   GridBackend backend) {
  if (!truth.empty()) return ShownWorld(truth);
  for (const TrackCell* cell : pair) {
    if (!HasShownModel(*cell, backend)) continue;
    return ShownWorld(ReadReconstruction(cell->Model(backend)).cam_from_world);
  }
  return ShownWorld({});
}

const TrackCell* FindCell(const std::vector<const TrackCell*>& cells, const std::string& tracker) {
  const auto it = std::find_if(cells.begin(), cells.end(), [&](const TrackCell* cell) {
    return cell->tracker.name == tracker;
  });
  return it == cells.end() ? nullptr : *it;
}

// The cells of these trackers for the same clip and level, with the first seed for which all have a
// model, if there is one.
std::vector<const TrackCell*> WithModels(const ExperimentResults& results,
                                         const std::vector<const TrackCell*>& cells,
                                         GridBackend backend) {
  std::map<unsigned, std::vector<const TrackCell*>> by_seed;
  for (const TrackCell* shown : cells) {
    for (const TrackCell& cell : results.cells) {
      const Condition& a = cell.condition;
      const Condition& b = shown->condition;
      if (cell.tracker.name == shown->tracker.name && a.clip.name == b.clip.name &&
          a.level == b.level && HasShownModel(cell, backend)) {
        by_seed[a.seed].push_back(&cell);
      }
    }
  }
  for (const auto& [seed, of_seed] : by_seed) {
    if (of_seed.size() == cells.size()) return of_seed;
  }
  return cells;
}

bool Ran(const ExperimentResults& results, GridBackend backend) {
  return std::any_of(results.rows.begin(), results.rows.end(), [&](const ResultRow& row) {
    return row.backend == NameOf(kGridBackendNames, backend);
  });
}

// The cells of the best KLT and of the cohort; without a headline, those of the first two trackers.
std::vector<const TrackCell*> PairToShow(const ExperimentResults& results,
                                         const std::vector<const TrackCell*>& cells,
                                         const std::optional<Headline>& headline,
                                         GridBackend backend) {
  const Condition& condition = cells.front()->condition;
  const TrackCell* left = cells.front();
  const TrackCell* right = cells.size() > 1 ? cells[1] : nullptr;
  if (headline) {
    const ResultCell cell{
        condition.clip.name, condition.level, "", std::string(NameOf(kGridBackendNames, backend))};
    const auto klt =
        BestTracker(ResultIndex(results), cell, kCameraErrorMetric, StandingRivals().front());
    if (klt) left = FindCell(cells, *klt);
    for (const char* name : {"klt31", "klt21", "klt"}) {
      if (!klt && FindCell(cells, name) != nullptr) left = FindCell(cells, name);  // all failed
    }
    right = FindCell(cells, headline->cohort);
  }
  std::vector<const TrackCell*> pair;
  for (const TrackCell* cell : {left, right}) {
    if (cell != nullptr && cell->Has(backend)) pair.push_back(cell);
  }
  return pair;
}

// The true poses of the frames in the sequence.
std::map<FrameIndex, Rigid3> TruePoses(Sequence& sequence) {
  std::map<FrameIndex, Rigid3> poses;
  const std::map<FrameIndex, Rigid3>& all = sequence.TrueCamFromWorld();
  if (all.empty()) return poses;
  while (const auto frame = sequence.Next()) {
    const auto pose = all.find(frame->index);
    if (pose != all.end()) poses.insert(*pose);
  }
  return poses;
}

}  // namespace

Eigen::Vector3d MiddleOfCameras(const std::map<FrameIndex, Rigid3>& cam_from_world) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& [frame, pose] : cam_from_world) sum += pose.Inverse().translation;
  return sum / std::max<double>(1.0, static_cast<double>(cam_from_world.size()));
}

Json ModelsToJson(const ExperimentResults& results,
                  const std::vector<const TrackCell*>& cells,
                  const std::optional<Headline>& headline) {
  const GridBackend backend =
      !Ran(results, GridBackend::kCeres) && Ran(results, GridBackend::kColmap)
          ? GridBackend::kColmap
          : GridBackend::kCeres;
  std::vector<const TrackCell*> pair = PairToShow(results, cells, headline, backend);
  if (pair.empty()) return nullptr;
  pair = WithModels(results, pair, backend);
  const InputOptions& frames = pair.front()->frames;
  const auto sequence = OpenInput(frames);
  const std::map<FrameIndex, Rigid3> truth = TruePoses(*sequence);
  const auto point_truth = OpenTrackTruth(*sequence, frames.input);
  const ShownWorld world = WorldOf(truth, pair, backend);
  Json models = Json::array();
  for (const TrackCell* cell : pair) {
    models.push_back(ModelOf(*cell, backend, world, truth, point_truth.get()));
  }
  Json up = Json::array();
  AppendShown(world.up, up);
  const Condition& condition = cells.front()->condition;
  return {{"sequence", condition.clip.name},
          {"level", condition.level},
          {"seed", pair.front()->condition.seed},
          {"backend", NameOf(kGridBackendNames, backend)},
          {"up", up},
          {"truth", PathOf(truth, Sim3{}, world)},
          {"models", models}};
}

}  // namespace cohort
