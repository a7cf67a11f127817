#include "pipelines/sfm/reconstruct.h"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "backend/adjust/rolling_shutter.h"
#include "backend/adjust/working_model.h"
#include "backend/colmap/database.h"
#include "backend/colmap/model_io.h"
#include "backend/colmap/program.h"
#include "backend/scene/phrasebook.h"
#include "frontend/storage/output.h"
#include "pipelines/json/json_file.h"
#include "pipelines/sfm/summary_json.h"
#include "pipelines/sfm/video_frames.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// Removed with all its contents at the end of the scope.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "cohort-XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) {
      ThrowError("cannot make a folder {}: {}", name, std::strerror(errno));
    }
    path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

// Mean of min(|error|^2, bound^2) [px^2] of `model`, over the observations that have a pose and a
// point in both models.
double Misfit(const TrackSet& tracks, const Reconstruction& model, const Reconstruction& other) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& [feature, point] : model.points) {
    if (!other.points.contains(feature)) continue;
    for (const Observation& o : tracks.Track(feature)) {
      const auto pose = model.cam_from_world.find(o.frame);
      if (!IsObserved(o) || pose == model.cam_from_world.end() ||
          !other.cam_from_world.contains(o.frame)) {
        continue;
      }
      constexpr double kBound = kMaxReprojectionPx * kMaxReprojectionPx;
      const auto xy = CameraOf(model, o.frame).Project(pose->second * point.in_world);
      sum += xy ? std::min((*xy - o.xy).squaredNorm(), kBound) : kBound;
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

// Whether COLMAP's mapper registered too few frames, or ended far from the optimum of the tracks.
// On real clips, its good models had up to 1.3 times the misfit of those by Ceres, and a bent one 7
// times.
bool MayBeStuck(const TrackSet& tracks,
                const ReconstructResult& mapped,
                const MapperResult& ceres) {
  constexpr double kMuchWorse = 2.0;
  if (mapped.summary.Failed()) return ceres.summary.registered > mapped.summary.registered;
  return Misfit(tracks, mapped.reconstruction, ceres.reconstruction) >
         kMuchWorse * Misfit(tracks, ceres.reconstruction, mapped.reconstruction);
}

ReconstructResult MapByColmap(const TrackFile& file,
                              const ColmapOptions& options,
                              const fs::path& work_folder) {
  ColmapResult model = ReconstructWithColmap(file, options, work_folder);
  return {std::move(model.reconstruction), std::move(model.summary), {}, std::nullopt};
}

// Whether a doubt by Ceres concerns the tracks, and thus any model of them, or only its own model.
bool IsOfTracks(DoubtCode code) {
  switch (code) {
    case DoubtCode::kOnlyTurns:
    case DoubtCode::kWeakDepth:
    case DoubtCode::kUnexplainedParallax:
    case DoubtCode::kCameraContradicted:
    case DoubtCode::kExcessNoise:
    case DoubtCode::kTwoCameras:
    case DoubtCode::kFocalChanges:
    case DoubtCode::kCenterMoves:
    case DoubtCode::kFocalUncertain:
    case DoubtCode::kCamerasUncertain:
    case DoubtCode::kPointsOnALine:
    case DoubtCode::kFewPoints:
    case DoubtCode::kThingsMove:
      return true;
    case DoubtCode::kFewFrames:
    case DoubtCode::kParts:
    case DoubtCode::kWorthless:
    case DoubtCode::kNoModelByCeres:
    case DoubtCode::kNotJudged:
    case DoubtCode::kOther:
      return false;
  }
  return false;
}

// COLMAP does not judge its models: it also registers cameras that only turn, because its points
// may then lie anywhere. The doubts of Ceres about the same tracks are therefore used.
std::vector<Doubt> DoubtsByCeres(const MapperResult& by_ceres) {
  if (by_ceres.summary.registered == 0) {
    return {NoModelByCeresDoubt(by_ceres.summary.termination)};
  }
  std::vector<Doubt> doubts;
  for (const Doubt& doubt : by_ceres.summary.reasons) {
    if (IsOfTracks(doubt.code)) doubts.push_back(AsDoubtByCeres(doubt));
  }
  return doubts;
}

void AddDoubts(std::vector<Doubt> doubts, ReconstructResult& result) {
  if (result.summary.registered == 0) return;
  std::ranges::move(doubts, std::back_inserter(result.summary.reasons));
}

// The model of COLMAP's mapper or, if it got stuck, that of its bundle adjuster from the model of
// Ceres, if this is the better optimum.
ReconstructResult MapOrAdjust(const TrackFile& file,
                              const MapperResult& by_ceres,
                              const ReconstructOptions& options,
                              const fs::path& work_folder) {
  ReconstructResult mapped = MapByColmap(file, options.colmap, work_folder);
  if (!options.ceres_start || !MayBeStuck(file.tracks, mapped, by_ceres)) return mapped;
  ColmapResult adjusted =
      AdjustWithColmap(file, by_ceres.reconstruction, options.colmap, work_folder / "from_ceres");
  const Reconstruction& model = adjusted.reconstruction;
  if (model.cam_from_world.empty()) return mapped;
  if (!mapped.summary.Failed() && Misfit(file.tracks, model, mapped.reconstruction) >
                                      Misfit(file.tracks, mapped.reconstruction, model)) {
    return mapped;
  }
  adjusted.summary.seconds += mapped.summary.seconds;
  adjusted.summary.termination +=
      fmt::format(", that of Ceres; COLMAP's mapper: {}", mapped.summary.termination);
  return {std::move(adjusted.reconstruction), std::move(adjusted.summary), {}, std::nullopt};
}

ReconstructResult ReconstructByColmap(TrackFile file,
                                      ReconstructOptions options,
                                      const fs::path& work_folder,
                                      const StageProgress& progress) {
  RequireColmap(options.colmap.program, options.colmap.max_minutes);
  // Tracks of pictures that did not come from files have none to write.
  if (file.image_root.empty() && !file.source.empty() && options.write_frames) {
    fs::create_directories(work_folder);
    WriteVideoFrames(file, work_folder / "images", progress);
    file.image_root = (work_folder / "images").string();
  }
  if (!options.global_shutter && !options.ceres_start) {
    ReconstructResult mapped = MapByColmap(file, options.colmap, work_folder);
    AddDoubts({NotJudgedDoubt()}, mapped);
    return mapped;
  }
  const MapperResult by_ceres = ReconstructWithCeres(file, options.ceres);
  if (options.ceres_start && !file.KnowsCamera() && !by_ceres.summary.Failed()) {
    file.camera = by_ceres.reconstruction.camera;
    options.colmap.hold_guess = true;
    options.colmap.focal_scale = by_ceres.reconstruction.focal_scale;
  }
  const auto map = [&](const TrackFile& tracks) {
    ReconstructResult mapped = MapOrAdjust(tracks, by_ceres, options, work_folder);
    AddDoubts(DoubtsByCeres(by_ceres), mapped);
    return mapped;
  };
  if (!options.global_shutter || by_ceres.reconstruction.readout == 0.0) return map(file);
  ReconstructResult result = map(AsGlobalShutter(file, by_ceres.reconstruction));
  // A bent model of Ceres may correct positions that were right.
  if (result.summary.Failed()) return map(file);
  result.reconstruction.camera.row_order = by_ceres.reconstruction.camera.row_order;
  MoveViewsToTracks(file.tracks, by_ceres.reconstruction.readout, result.reconstruction);
  return result;
}

// Upper triangle, row by row.
template <typename Matrix>
std::string CovarianceRow(std::uint32_t id, const Matrix& covariance) {
  std::string row = fmt::format("{}", id);
  for (int i = 0; i < covariance.rows(); ++i) {
    for (int j = i; j < covariance.cols(); ++j) row += fmt::format(",{:.6g}", covariance(i, j));
  }
  return row + "\n";
}

std::string CovarianceHeader(const std::string& id, const std::vector<std::string>& names) {
  std::string header = id;
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (std::size_t j = i; j < names.size(); ++j) header += "," + names[i] + "_" + names[j];
  }
  return header + "\n";
}

void WriteCovariances(const CeresFindings& findings, const fs::path& folder) {
  std::string cameras = CovarianceHeader("frame", {"wx", "wy", "wz", "cx", "cy", "cz"});
  for (const auto& [frame, covariance] : findings.camera_covariances) {
    cameras += CovarianceRow(ToInt(frame), covariance);
  }
  std::string points = CovarianceHeader("track_id", {"x", "y", "z"});
  for (const auto& [feature, covariance] : findings.point_covariances) {
    points += CovarianceRow(ToInt(feature), covariance);
  }
  WriteBytes(folder / "camera_covariances.csv", cameras);
  WriteBytes(folder / "point_covariances.csv", points);
}

// Renumbers a model that was read as if its images were numbered by frame, with the frames in
// `of_image`: a list of [image id, frame].
Reconstruction WithFrames(Reconstruction model, const Json& of_image, const fs::path& summary) {
  std::map<FrameIndex, FrameIndex> frames;  // by the frame of the image's number
  try {
    for (const auto& [image, frame] :
         of_image.get<std::vector<std::pair<ColmapImageId, std::uint32_t>>>()) {
      frames[FrameOfColmapImage(image)] = FrameIndex{frame};
    }
  } catch (const Json::exception&) {
    frames.clear();
  }
  std::set<FrameIndex> apart;
  for (const auto& [number, frame] : frames) apart.insert(frame);
  const bool has_all = std::ranges::all_of(
      model.cam_from_world, [&](const auto& camera) { return frames.contains(camera.first); });
  if (!has_all || apart.size() < frames.size()) {
    ThrowError(
        "{}: frame_of_image does not have one frame for every image of the model: make it again",
        summary.string());
  }
  const auto renumber = [&frames](auto& map) {
    std::remove_reference_t<decltype(map)> by_frame;
    for (auto& [number, value] : map) by_frame.emplace(frames.at(number), std::move(value));
    map = std::move(by_frame);
  };
  // trajectory.tum lists the times in the order of the frames.
  std::vector<std::int64_t> times;
  for (const auto& [number, time] : model.timestamps_ns) times.push_back(time);
  renumber(model.focal_scale);
  renumber(model.cam_from_world);
  renumber(model.frame_names);
  renumber(model.timestamps_ns);
  auto time = times.begin();
  for (auto& [frame, ns] : model.timestamps_ns) ns = *time++;
  for (auto& [feature, point] : model.points) {
    for (PointView& view : point.views) view.frame = frames.at(view.frame);
    std::ranges::sort(point.views, {}, &PointView::frame);
  }
  return model;
}

// Calls `use` with the pairs of a list that summary.json has under `key`.
template <typename Second, typename Use>
void ForEachPair(const Json& list, const char* key, const fs::path& summary, const Use& use) {
  try {
    for (const auto& [first, second] : list.get<std::vector<std::pair<std::uint32_t, Second>>>()) {
      use(FrameIndex{first}, second);
    }
  } catch (const Json::exception&) {
    ThrowError("{}: {} is not a list of pairs of numbers: make it again", summary.string(), key);
  }
}

// Their names and times are not in summary.json.
std::vector<RepeatedFrame> RepeatsOf(const Json& list, const fs::path& summary) {
  std::vector<RepeatedFrame> repeats;
  ForEachPair<std::uint32_t>(list, "repeats", summary, [&](FrameIndex frame, std::uint32_t from) {
    repeats.push_back({{.index = frame, .name = {}}, FrameIndex{from}});
  });
  return repeats;
}

FrameTimes TimesOf(const Json& list, const fs::path& summary) {
  FrameTimes times;
  ForEachPair<double>(
      list, "frame_times", summary, [&](FrameIndex frame, double time) { times[frame] = time; });
  return times;
}

}  // namespace

ReconstructResult ToReconstructResult(MapperResult model) {
  return {std::move(model.reconstruction),
          std::move(model.summary),
          std::move(model.warnings),
          static_cast<CeresFindings&&>(model)};
}

void WriteCeresFindings(const CeresFindings& findings,
                        const TrackFile& file,
                        const fs::path& folder) {
  std::string without_point = "track_id,observations\n";
  for (const FeatureId feature : findings.without_point) {
    without_point += fmt::format("{},{}\n", ToInt(feature), file.tracks.Track(feature).size());
  }
  WriteBytes(folder / "tracks_without_point.csv", without_point);
  if (!findings.camera_covariances.empty()) WriteCovariances(findings, folder);
  for (std::size_t i = 0; i < findings.other_parts.size(); ++i) {
    const fs::path part = folder / "other_parts" / fmt::format("{}", i + 1);
    fs::create_directories(part);
    WriteReconstructionFiles(part, findings.other_parts[i]);
    WriteJsonFile(part / "summary.json", SummaryOfPart(findings.other_parts[i], file.frames));
  }
}

ReconstructResult Reconstruct(const TrackFile& file,
                              const ReconstructOptions& options,
                              const fs::path& colmap_folder,
                              const StageProgress& progress) {
  switch (options.backend) {
    case BackendKind::kCeres:
      return ToReconstructResult(ReconstructWithCeres(file, options.ceres));
    case BackendKind::kColmap:
      if (!colmap_folder.empty()) {
        return ReconstructByColmap(file, options, colmap_folder, progress);
      }
      const TemporaryFolder temporary;
      return ReconstructByColmap(file, options, temporary.path() / "colmap", progress);
  }
  ThrowUsageError("unknown backend");
}

Reconstruction ReadModelFolder(const fs::path& folder) {
  Reconstruction model = ReadReconstruction(folder);
  const fs::path summary = folder / "summary.json";
  if (!fs::exists(summary)) return model;
  const Json json = ReadJsonFile(summary);
  if (json.contains("frame_of_image")) {
    model = WithFrames(std::move(model), json["frame_of_image"], summary);
  }
  if (json.contains("readout") && json["readout"].is_number()) {
    model.readout = json["readout"].get<double>();
  }
  if (json.contains("repeats")) model.repeats = RepeatsOf(json["repeats"], summary);
  if (json.contains("frame_times")) model.frame_times = TimesOf(json["frame_times"], summary);
  if (json.contains("row_order") && json["row_order"].is_string()) {
    model.camera.row_order =
        ValueOf(kRowOrderNames, json["row_order"].get<std::string>()).value_or(RowOrder::kDown);
  }
  return model;
}

void WriteModelFolder(const Reconstruction& model,
                      const std::string& summary,
                      const fs::path& folder) {
  OutputFolder out(folder, ModelFolderNames(), IsOurModelFolder);
  if (!model.cam_from_world.empty()) WriteReconstructionFiles(out.partial(), model);
  Json json = Json::parse(summary);
  json.erase("frame_of_image");  // the written images are numbered by frame
  if (!json.empty()) WriteJsonFile(out.partial() / "summary.json", json);
  out.Commit();
}

ReconstructResult ReconstructIntoFolder(const TrackFile& file,
                                        const ReconstructOptions& options,
                                        const fs::path& folder,
                                        const StageProgress& progress,
                                        const std::string& summary_options) {
  OutputFolder out(folder, ModelFolderNames(), IsOurModelFolder);
  ReconstructResult result = Reconstruct(file, options, out.partial() / "colmap", progress);
  if (!result.reconstruction.cam_from_world.empty()) {
    WriteReconstructionFiles(out.partial(), result.reconstruction);
  }
  if (result.ceres) WriteCeresFindings(*result.ceres, file, out.partial());
  Json summary = SummaryToJson(result, file.frames, options);
  if (!summary_options.empty()) summary["options"] = Json::parse(summary_options);
  WriteJsonFile(out.partial() / "summary.json", summary);
  out.Commit();
  return result;
}

}  // namespace cohort
