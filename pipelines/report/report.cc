#include "pipelines/report/report.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <span>

#include "backend/colmap/model_io.h"
#include "datasets/degrade/degrade.h"
#include "datasets/truth/track_truth.h"
#include "frontend/core/output.h"
#include "frontend/core/statistics.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/version.h"
#include "pipelines/evaluation/alignment.h"
#include "pipelines/json/json_file.h"
#include "pipelines/report/headline.h"
#include "pipelines/report/report_page.h"
#include "pipelines/report/track_picture.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Of the machine, not of the trackers.
const std::set<std::string> kTimes{"seconds", "detect_time", "track_time"};

Json RowsOf(const ExperimentResults& results) {
  Json rows = Json::array();
  for (const ResultRow& row : results.rows) {
    if (kTimes.contains(row.metric)) continue;
    rows.push_back(
        {row.sequence, row.level, row.tracker, row.backend, row.seed, row.metric, row.value});
  }
  return rows;
}

Json NotesOf(const std::vector<CellNote>& notes) {
  Json list = Json::array();
  for (const CellNote& note : notes) {
    list.push_back({note.sequence, note.level, note.tracker, note.backend, note.seed, note.reason});
  }
  return list;
}

// What a level does to the frames, and its place on the axis of darkness (none: as-is, sensor).
Json LevelOf(const std::string& level) {
  if (level == kAsIs) return {{"name", level}, {"about", "the clips as they are"}};
  if (level == kSensor) {
    const SensorLevel sensor = SensorLevelAt(ParseLevel(kSensorLevel));
    return {{"name", level},
            {"about",
             fmt::format("a camera sensor at {:.0f} % of the light: photon and read noise, gain, "
                         "motion blur",
                         100.0 * sensor.gain)}};
  }
  const PaperLevel paper = PaperLevelAt(ParseLevel(level));
  std::string about = fmt::format("{:.0f} % of the light, noise of {:.1f} % of the full range",
                                  100.0 * paper.gain,
                                  100.0 * paper.noise_before);
  if (paper.blur_px > 0.0) {
    about += fmt::format(
        ", blur of {:.1f} px, noise of {:.1f} % again", paper.blur_px, 100.0 * paper.noise_after);
  }
  return {{"name", level}, {"darkness", ParseLevel(level)}, {"about", about}};
}

Json RatioOf(const std::optional<HeadlineRatio>& ratio) {
  if (!ratio) return nullptr;
  return {{"value", ratio->value},
          {"least", ratio->least},
          {"largest", ratio->largest},
          {"clips", ratio->clips}};
}

template <typename T>
Json OrNull(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json HeadlineOf(const std::optional<Headline>& headline) {
  if (!headline) return nullptr;
  Json rows = Json::array();
  Json others = Json::array();
  for (const HeadlineRow& row : headline->rows) {
    for (const OtherTracker& other : row.others) {
      others.push_back({{"level", row.level},
                        {"backend", row.backend},
                        {"clips", row.clips},
                        {"name", other.name},
                        {"camera", RatioOf(other.camera)},
                        {"points", RatioOf(other.points)},
                        {"length", RatioOf(other.length)},
                        {"registered", OrNull(other.registered)},
                        {"failed", other.failed}});
    }
    rows.push_back({{"level", row.level},
                    {"backend", row.backend},
                    {"clips", row.clips},
                    {"camera_klt", RatioOf(row.camera_klt)},
                    {"camera_anchored", RatioOf(row.camera_anchored)},
                    {"camera_refined", RatioOf(row.camera_refined)},
                    {"camera_ceiling", RatioOf(row.camera_ceiling)},
                    {"points_klt", RatioOf(row.points_klt)},
                    {"points_anchored", RatioOf(row.points_anchored)},
                    {"points_refined", RatioOf(row.points_refined)},
                    {"length_klt", RatioOf(row.length_klt)},
                    {"registered", OrNull(row.registered)},
                    {"registered_klt", OrNull(row.registered_klt)},
                    {"failed", row.failed},
                    {"failed_klt", row.failed_klt},
                    {"failed_anchored", row.failed_anchored}});
  }
  Json losses = Json::array();
  for (const Loss& loss : headline->losses) {
    losses.push_back({{"sequence", loss.sequence},
                      {"level", loss.level},
                      {"backend", loss.backend},
                      {"metric", loss.metric},
                      {"rival", loss.rival},
                      {"cohort", OrNull(loss.cohort)},
                      {"best", loss.best}});
  }
  return {{"cohort", headline->cohort},
          {"contests", headline->contests},
          {"rows", rows},
          {"others", others},
          {"losses", losses}};
}

// The clip, level and seed whose tracks and models are shown: the first clip (with truth, if any
// has), the darkest level, the first seed. Not chosen by what came out.
std::vector<const TrackCell*> ShowcaseCells(const ExperimentResults& results) {
  const auto darkness = [](const Condition& condition) {
    if (!condition.IsDegraded()) return -1.0;
    return condition.level == kSensor ? 1.5 : ParseLevel(condition.level);
  };
  const Condition* shown = nullptr;
  for (const TrackCell& cell : results.cells) {
    const Condition& c = cell.condition;
    const auto rank = [&](const Condition& condition) {
      return std::pair(condition.clip.has_track_truth, darkness(condition));
    };
    if (shown == nullptr || rank(c) > rank(*shown)) shown = &c;
  }
  std::vector<const TrackCell*> cells;
  if (shown == nullptr) return cells;
  for (const TrackCell& cell : results.cells) {
    if (cell.condition.folder == shown->folder) cells.push_back(&cell);
  }
  return cells;
}

// The darkest frame, but for the first ones, in which tracks have no past yet.
std::optional<Frame> DarkestFrame(Sequence& sequence) {
  constexpr int kSkipped = 10;
  std::optional<Frame> darkest;
  double least = 0.0;
  for (int i = 0; auto frame = sequence.Next(); ++i) {
    const double mean = cv::mean(frame->gray)[0];
    if (!darkest || i <= kSkipped || mean < least) {
      darkest = frame;
      darkest->gray = frame->gray.clone();
      least = mean;
    }
  }
  return darkest;
}

Json PicturesOf(const std::vector<const TrackCell*>& cells) {
  Json trackers = Json::array();
  const TrackCell& first = *cells.front();
  const auto sequence = OpenInput(first.frames);
  const auto truth = OpenTrackTruth(*sequence, first.frames.input);
  const auto frame = DarkestFrame(*sequence);
  if (!frame) return nullptr;
  for (const TrackCell* cell : cells) {
    if (!fs::exists(cell->Tracks())) continue;
    const TrackFile file = ReadTrackFile(cell->Tracks());
    const TrackPicture picture = DrawTracks(*frame, file.tracks, truth.get());
    trackers.push_back({{"tracker", cell->tracker.name},
                        {"observed", picture.observed},
                        {"predicted", picture.predicted},
                        {"near", picture.near_truth},
                        {"far", picture.far},
                        {"width", picture.picture.cols},
                        {"height", picture.picture.rows},
                        {"src", JpegDataUri(picture.picture)}});
  }
  return {{"sequence", first.condition.clip.name},
          {"level", first.condition.level},
          {"seed", first.condition.seed},
          {"frame", ToInt(frame->index)},
          {"has_truth", truth != nullptr},
          {"trackers", trackers}};
}

double Rounded(double value) { return std::round(value * 1e4) / 1e4; }

void Append(const Eigen::Vector3d& x, Json& list) {
  for (const double value : {x.x(), x.y(), x.z()}) list.push_back(Rounded(value));
}

Json PathOf(const std::map<FrameIndex, Rigid3>& cam_from_world, const Sim3& shown_from_world) {
  Json path = Json::array();
  for (const auto& [frame, pose] : cam_from_world) {
    Append(shown_from_world * pose.Inverse().translation, path);
  }
  return path;
}

// How far a point is off, as a share of its distance from the camera that saw it first: 0 up to 1
// %, 1 up to 5 %, 2 beyond, 3 where the truth does not know.
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

// Every n-th point, without the 2 % that lie farthest from the cameras, which would shrink the
// rest.
ShownPoints PointsOf(const Reconstruction& model,
                     const Sim3& shown_from_world,
                     const std::map<FrameIndex, Rigid3>& true_poses,
                     TrackTruth* truth) {
  constexpr std::size_t kMostPoints = 4000;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const auto& [frame, pose] : model.cam_from_world) middle += pose.Inverse().translation;
  middle /= static_cast<double>(std::max<std::size_t>(1, model.cam_from_world.size()));
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
    Append(shown_from_world * point.in_world, points.xyz);
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

// A tracker's reconstruction in the frame of the truth or, without, in that of `reference`.
Json ModelOf(const TrackCell& cell,
             GridBackend backend,
             const std::map<FrameIndex, Rigid3>& truth,
             TrackTruth* point_truth,
             std::optional<Reconstruction>& reference) {
  Json json{{"tracker", cell.tracker.name}};
  const fs::path folder = cell.Model(backend);
  if (!fs::exists(folder / "images.bin")) {
    json["failed"] = true;
    return json;
  }
  const Reconstruction model = ReadReconstruction(folder);
  const auto alignment =
      AlignmentWith(!truth.empty() || !reference ? truth : reference->cam_from_world, model);
  const Sim3 shown_from_world = alignment.value_or(Sim3{});
  json["path"] = PathOf(model.cam_from_world, shown_from_world);
  ShownPoints points = PointsOf(model, shown_from_world, truth, point_truth);
  json["points"] = std::move(points.xyz);
  json["error_classes"] = std::move(points.error_classes);
  if (!reference) reference = model;
  return json;
}

const TrackCell* Find(const std::vector<const TrackCell*>& cells, const std::string& tracker) {
  const auto it = std::find_if(cells.begin(), cells.end(), [&](const TrackCell* cell) {
    return cell->tracker.name == tracker;
  });
  return it == cells.end() ? nullptr : *it;
}

// The cells of these trackers at the same clip and level; of the first seed in which all have a
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
          a.level == b.level && fs::exists(cell.Model(backend) / "images.bin")) {
        by_seed[a.seed].push_back(&cell);
      }
    }
  }
  for (const auto& [seed, of_seed] : by_seed) {
    if (of_seed.size() == cells.size()) return of_seed;
  }
  return cells;
}

// The best KLT's reconstruction and the cohort's; without these the first two trackers'.
Json ModelsOf(const ExperimentResults& results,
              const std::vector<const TrackCell*>& cells,
              const std::optional<Headline>& headline) {
  const Condition& condition = cells.front()->condition;
  const auto has = [&](GridBackend backend) {
    return std::any_of(results.rows.begin(), results.rows.end(), [&](const ResultRow& row) {
      return row.backend == NameOf(kGridBackendNames, backend);
    });
  };
  GridBackend backend = GridBackend::kCeres;
  for (const GridBackend candidate : {GridBackend::kColmap, GridBackend::kCeres}) {
    if (has(candidate)) backend = candidate;
  }
  const TrackCell* left = cells.front();
  const TrackCell* right = cells.size() > 1 ? cells[1] : nullptr;
  if (headline) {
    const auto klt = BestTracker(results,
                                 condition.clip.name,
                                 condition.level,
                                 std::string(NameOf(kGridBackendNames, backend)),
                                 "ate",
                                 "klt");
    if (klt) left = Find(cells, *klt);
    for (const char* name : {"klt31", "klt21", "klt"}) {
      if (!klt && Find(cells, name) != nullptr) left = Find(cells, name);  // which all failed
    }
    right = Find(cells, headline->cohort);
  }
  std::vector<const TrackCell*> pair;
  for (const TrackCell* cell : {left, right}) {
    if (cell != nullptr && cell->Has(backend)) pair.push_back(cell);
  }
  if (pair.empty()) return nullptr;
  pair = WithModels(results, pair, backend);
  const InputOptions& frames = pair.front()->frames;
  const auto sequence = OpenInput(frames);
  std::map<FrameIndex, Rigid3> truth;
  const std::map<FrameIndex, Rigid3>& all = sequence->TrueCamFromWorld();
  if (!all.empty()) {
    while (const auto frame = sequence->Next()) {
      const auto pose = all.find(frame->index);
      if (pose != all.end()) truth.insert(*pose);
    }
  }
  const auto point_truth = OpenTrackTruth(*sequence, frames.input);
  std::optional<Reconstruction> reference;
  Json models = Json::array();
  for (const TrackCell* cell : pair) {
    models.push_back(ModelOf(*cell, backend, truth, point_truth.get(), reference));
  }
  return {{"sequence", condition.clip.name},
          {"level", condition.level},
          {"seed", pair.front()->condition.seed},
          {"backend", NameOf(kGridBackendNames, backend)},
          {"truth", PathOf(truth, Sim3{})},
          {"models", models}};
}

// Normalised errors by level and tracker, over clips and seeds.
Json CalibrationOf(const ExperimentResults& results) {
  struct Sum {
    std::vector<std::size_t> histogram;
    double sigmas = 0.0;
    std::size_t numbers = 0;
    std::vector<double> nees_ratios;
  };
  std::vector<std::pair<std::string, std::string>> order;
  std::map<std::pair<std::string, std::string>, Sum> sums;
  for (const TrackCell& cell : results.cells) {
    const fs::path file = cell.TrackErrors();
    if (!fs::exists(file)) continue;
    const Json errors = ReadJsonFile(file);
    if (!errors.contains("calibration") || errors["calibration"].is_null()) continue;
    const Json& calibration = errors["calibration"];
    const std::pair key(cell.condition.level, cell.tracker.name);
    if (!sums.contains(key)) order.push_back(key);
    Sum& sum = sums[key];
    const auto histogram = calibration["histogram"].get<std::vector<std::size_t>>();
    sum.histogram.resize(histogram.size());
    for (std::size_t i = 0; i < histogram.size(); ++i) sum.histogram[i] += histogram[i];
    sum.sigmas = calibration["histogram_sigmas"];
    sum.numbers += 2 * calibration["count"].get<std::size_t>();
    sum.nees_ratios.push_back(calibration["nees_ratio"]);
  }
  Json list = Json::array();
  for (const auto& key : order) {
    const Sum& sum = sums[key];
    list.push_back({{"level", key.first},
                    {"tracker", key.second},
                    {"histogram", sum.histogram},
                    {"sigmas", sum.sigmas},
                    {"numbers", sum.numbers},
                    {"nees_ratio", InterpolatedMedian(sum.nees_ratios)}});
  }
  return list;
}

// What only illustrates: without it the page still stands.
template <typename Make>
Json Illustration(const char* what, const Make& make) {
  try {
    return make();
  } catch (const Error& error) {
    spdlog::warn("report without {}: {}", what, error.what());
    return nullptr;
  }
}

Json DataOf(const ExperimentResults& results, const ExperimentOptions& options) {
  const auto headline = MakeHeadline(results);
  std::set<std::string> seen;
  Json sequences = Json::array();
  for (const TrackCell& cell : results.cells) {
    const GridClip& clip = cell.condition.clip;
    if (!seen.insert(clip.name).second) continue;
    sequences.push_back({{"name", clip.name},
                         {"has_poses", clip.has_poses},
                         {"has_track_truth", clip.has_track_truth}});
  }
  Json trackers = Json::array();
  for (const TrackCell& cell : results.cells) {
    if (cell.condition.folder != results.cells.front().condition.folder) break;
    trackers.push_back(cell.tracker.name);
  }
  Json levels = Json::array();
  for (const std::string& level : options.levels) levels.push_back(LevelOf(level));
  Json data{{"program", fmt::format("cohort {}", kVersion)},
            {"sequences", sequences},
            {"levels", levels},
            {"trackers", trackers},
            {"backends", options.backends},
            {"seeds", options.seeds},
            {"frames", options.frames},
            {"features", options.tracking.detector.max_features},
            {"headline", HeadlineOf(headline)},
            {"rows", RowsOf(results)},
            {"failures", NotesOf(results.failures)},
            {"not_available", NotesOf(results.not_available)},
            {"calibration", CalibrationOf(results)}};
  const std::vector<const TrackCell*> shown = ShowcaseCells(results);
  if (shown.empty()) return data;
  data["pictures"] = Illustration("pictures", [&] { return PicturesOf(shown); });
  data["models"] = Illustration("models", [&] { return ModelsOf(results, shown, headline); });
  return data;
}

}  // namespace

void WriteReport(const fs::path& path,
                 const ExperimentResults& results,
                 const ExperimentOptions& options) {
  std::string data = DataOf(results, options).dump(-1, ' ', false, Json::error_handler_t::replace);
  // Nothing in the data may end the script element that it stands in.
  for (std::size_t at = data.find('<'); at != std::string::npos; at = data.find('<', at + 1)) {
    data.replace(at, 1, "\\u003c");
  }
  std::string page(kReportPage);
  page.replace(page.find(kReportDataMark), kReportDataMark.size(), data);
  OutputFile out(path);
  WriteBytes(out.partial(), page);
  out.Commit();
}

}  // namespace cohort
