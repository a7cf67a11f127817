#include "pipelines/sfm/refine_model.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "backend/colmap/camera_model.h"
#include "backend/scene/near_world.h"
#include "frontend/geometry/sim3.h"
#include "frontend/storage/output.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/for_each_frame.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/reconstruct.h"
#include "pipelines/sfm/summary_json.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTracksName = "clip.tracks";

// The shared camera of the images or, if the focal length changes, that of the first image.
const ColmapCamera& FirstCameraOf(const ColmapModel& model) {
  return model.cameras.at(model.images.begin()->second.camera_id);
}

// Throws Error if so few of the model's points look the same in the frames that see them that these
// are not its pictures, or that the model is far off.
void CheckFound(const SecondPassFigures& figures, const fs::path& path, const Sequence& sequence) {
  constexpr double kLeastFound = 0.1;
  const std::size_t points = figures.replaced + figures.left;
  if (points == 0 && figures.masked > 0) {
    ThrowError(
        "{}: the mask covers all of its {} points: give a mask that is white at these points",
        path.string(),
        figures.masked);
  }
  if (static_cast<double>(figures.replaced) >= kLeastFound * static_cast<double>(points) &&
      figures.replaced > 0) {
    return;
  }
  ThrowError(
      "{}: only {} of its {} points look alike in the frames of {} that see them: give the "
      "pictures that the model was made from",
      path.string(),
      figures.replaced,
      points,
      sequence.Name());
}

// By how many frames the poses of a model may be late.
constexpr std::array<int, 3> kShifts{0, 1, -1};
constexpr double kClearly = 1.1;  // 1.29 on a clip that moves 4 px a frame, 0.76 if none is late

// How strong corners the model's points are in some pictures of the clip, if every picture has the
// pose of the frame that many later: the mean over all points that both poses see.
std::array<double, 3> CornersAtPoints(const ModelOfClip& clip,
                                      Sequence& sequence,
                                      const StageProgress& progress) {
  constexpr std::size_t kPictures = 12;
  constexpr double kSigmaPx = 1.5;
  constexpr int kBlockPx = 7;
  constexpr double kBorderPx = 8.0;
  const Reconstruction& model = clip.reconstruction;
  const std::vector<FrameInfo>& frames = clip.file.frames;
  std::vector<FrameInfo> looked_at;
  std::map<FrameIndex, std::size_t> place;
  for (std::size_t i = 0; i < kPictures && frames.size() > 2; ++i) {
    const std::size_t at = 1 + i * (frames.size() - 2) / kPictures;
    if (place.emplace(frames[at].index, at).second) looked_at.push_back(frames[at]);
  }
  std::array<double, 3> sums{};
  std::size_t count = 0;
  if (looked_at.empty()) return sums;
  ForEachFrame(clip.file, looked_at, sequence, "look", progress, [&](const Frame& frame) {
    cv::Mat gray;
    frame.gray.convertTo(gray, CV_32F);
    cv::GaussianBlur(gray, gray, cv::Size(0, 0), kSigmaPx);
    cv::Mat strength;
    cv::cornerMinEigenVal(gray, strength, kBlockPx, 3);
    const std::size_t at = place.at(frame.index);
    for (const auto& [feature, point] : model.points) {
      if (clip.file.tracks.Find(feature, frame.index) == nullptr) continue;
      std::array<double, 3> here{};
      bool seen = true;
      for (std::size_t s = 0; s < kShifts.size() && seen; ++s) {
        const FrameIndex posed = frames[at + static_cast<std::size_t>(kShifts[s])].index;
        const auto pose = model.cam_from_world.find(posed);
        const auto xy = pose == model.cam_from_world.end()
                            ? std::nullopt
                            : CameraOf(model, posed).Project(pose->second * point.in_world);
        seen = xy && model.camera.Contains(*xy, kBorderPx);
        if (!seen) break;
        here[s] = std::sqrt(std::max(0.0F,
                                     strength.at<float>(static_cast<int>(std::lround(xy->y())),
                                                        static_cast<int>(std::lround(xy->x())))));
      }
      if (!seen) continue;
      for (std::size_t s = 0; s < kShifts.size(); ++s) sums[s] += here[s];
      ++count;
    }
  });
  for (double& sum : sums) sum /= static_cast<double>(std::max<std::size_t>(count, 1));
  return sums;
}

// Throws Error if every image of the model is the frame before or after the one of its name: one
// list counts from 1, as ffmpeg does, and the other from 0. Neighbours look alike, and points that
// are a frame off agree with each other, so that nothing else would reveal it.
void CheckCountsAlike(const ColmapModel& model,
                      const ModelOfClip& clip,
                      Sequence& sequence,
                      const fs::path& path,
                      const StageProgress& progress) {
  const std::array<double, 3> corners = CornersAtPoints(clip, sequence, progress);
  for (std::size_t s = 1; s < kShifts.size(); ++s) {
    // It rises from the shift in the other direction over none to this one.
    const double other = corners[kShifts.size() - s];
    if (corners[s] < kClearly * corners[0] || corners[0] <= other) continue;
    const FrameInfo& named = clip.file.frames[1];
    ThrowError(
        "{}: the pictures show that its image {} is not the frame of that name of {} but frame {}: "
        "one counts from 1 and the other from 0; give the pictures that the model was made from",
        path.string(),
        model.images.at(clip.image_ids.at(named.index)).name,
        sequence.Name(),
        ToInt(clip.file.frames[kShifts[s] > 0 ? 0 : 2].index));
  }
}

// Whether the point was never found again, or agrees with too few of its measurements.
bool IsContradicted(std::span<const Observation> track,
                    const Point3D& point,
                    const Reconstruction& model) {
  // On rendered clips in daylight, points below this share are within a centimetre of the surface
  // in a fifth of the cases, those with .5 to .7 in two fifths, the others in four fifths.
  constexpr double kLeastShare = 0.5;
  std::size_t sightings = 0;
  for (const Observation& o : track) {
    if (!IsObserved(o) || !model.cam_from_world.contains(o.frame)) continue;
    // Without a covariance it was not measured again: MeasureAgain gives one to every position.
    if (!o.covariance) return true;
    ++sightings;
  }
  return static_cast<double>(point.views.size()) < kLeastShare * static_cast<double>(sightings);
}

// Points that the pictures contradict, except those in frames with few other points.
std::set<FeatureId> FindContradicted(const TrackSet& tracks, const Reconstruction& model) {
  constexpr std::size_t kFewPoints = 30;
  std::set<FeatureId> contradicted;
  std::map<FrameIndex, std::size_t> sound;  // points per frame
  for (const auto& [feature, point] : model.points) {
    if (IsContradicted(tracks.Track(feature), point, model)) {
      contradicted.insert(feature);
      continue;
    }
    for (const PointView& view : point.views) ++sound[view.frame];
  }
  std::erase_if(contradicted, [&](FeatureId feature) {
    const auto& views = model.points.at(feature).views;
    return std::any_of(views.begin(), views.end(), [&](const PointView& view) {
      return sound[view.frame] < kFewPoints;
    });
  });
  return contradicted;
}

// COLMAP keeps its first model even if it is tiny, and may write a complete one beside it.
void CheckPointsAreLeft(const Reconstruction& adjusted,
                        const ReconstructionSummary& before,
                        const fs::path& path) {
  if (!adjusted.points.empty()) return;
  ThrowError(
      "{}: no point of its {} survives the adjustment of its {} images: give COLMAP's largest "
      "model",
      path.string(),
      before.points,
      before.registered);
}

void NoteWhatIsLeftOut(const ModelOfClip& clip,
                       const fs::path& path,
                       const Sequence& sequence,
                       std::vector<std::string>& notes) {
  if (clip.unknown_images > 0) {
    notes.push_back(
        fmt::format("{}: {} of its images are not frames of {} and are left out, such as {}",
                    path.string(),
                    clip.unknown_images,
                    sequence.Name(),
                    clip.an_unknown_image));
  }
}

nlohmann::ordered_json SummaryToJson(const RefinedModel& refined,
                                     const fs::path& path,
                                     const RefineModelOptions& options) {
  ReconstructOptions adjustment;
  adjustment.ceres = options.ceres;
  nlohmann::ordered_json json = SummaryToJson(refined.adjusted, refined.file.frames, adjustment);
  RefineModelOptions copy = options;
  OptionLister lister;
  RefineModelOptions::Visit(copy, lister);
  SecondPassOptions::VisitMeasurement(copy.second_pass, lister);
  json["options"] = OptionsToJson(lister.Take());
  json["points_before"] = refined.before.points;
  json["observations_before"] = refined.before.observations;
  json["mean_reprojection_before_px"] = refined.before.mean_reprojection_px;
  json["frame_range"] = RangeOf(refined.frames);
  json["refined_from"] = AbsolutePath(path);
  // Its images keep the numbers of the program that made it (ReadModelFolder).
  for (const auto& [frame, pose] : refined.adjusted.reconstruction.cam_from_world) {
    json["frame_of_image"].push_back({refined.image_ids.at(frame), ToInt(frame)});
  }
  json["camera_refined"] = refined.camera_refined;
  json["tracks_measured_again"] = refined.found.replaced;
  json["tracks_not_found_again"] = refined.found.left;
  json["masked_tracks"] = refined.found.masked;
  json["points_contradicted"] = refined.contradicted;
  return json;
}

// The similarity that aligns the cameras of `from` with those of `to`. Each camera is represented
// by its centre and a point on each of its axes, so that the rotation of cameras on a line is
// determined too. Returns nullopt if all cameras are at one position.
std::optional<Sim3> FindSimilarity(const Reconstruction& from, const Reconstruction& to) {
  const auto count = static_cast<Eigen::Index>(from.cam_from_world.size());
  if (count < 2) return std::nullopt;
  Eigen::Matrix3Xd centres(3, count);
  const auto cloud = [&](const Reconstruction& of) -> Eigen::Matrix3Xd {
    Eigen::Index next = 0;
    for (const auto& [frame, pose] : from.cam_from_world) {
      centres.col(next++) = of.cam_from_world.at(frame).Inverse().translation;
    }
    const Eigen::Vector3d mean = centres.rowwise().mean();
    const double extent =
        std::sqrt((centres.colwise() - mean).squaredNorm() / static_cast<double>(count));
    Eigen::Matrix3Xd points(3, 4 * count);
    next = 0;
    for (const auto& [frame, pose] : from.cam_from_world) {
      const Rigid3 world_from_cam = of.cam_from_world.at(frame).Inverse();
      points.col(next++) = world_from_cam.translation;
      for (int axis = 0; axis < 3; ++axis) {
        points.col(next++) = world_from_cam * Eigen::Vector3d(extent * Eigen::Vector3d::Unit(axis));
      }
    }
    return extent > 0.0 ? points : Eigen::Matrix3Xd();
  };
  const Eigen::Matrix3Xd source = cloud(from);
  const Eigen::Matrix3Xd target = cloud(to);
  if (source.size() == 0 || target.size() == 0) return std::nullopt;
  const Eigen::Matrix4d transform = Eigen::umeyama(source, target);
  const double scale = transform.topLeftCorner<3, 1>().norm();
  const Eigen::Matrix3d rotation = transform.topLeftCorner<3, 3>() / scale;
  return Sim3{scale, Eigen::Quaterniond(rotation), transform.topRightCorner<3, 1>()};
}

}  // namespace

MapperResult InWorldOf(const Reconstruction& world, MapperResult model) {
  const auto similarity = FindSimilarity(model.reconstruction, world);
  if (!similarity) return model;
  model.reconstruction = MoveWorld(*similarity, std::move(model.reconstruction));
  const Eigen::Matrix3d turn = similarity->scale * similarity->rotation.toRotationMatrix();
  for (auto& [feature, covariance] : model.point_covariances) {
    covariance = turn * covariance * turn.transpose();
  }
  // A camera's rotation is expressed in its own axes, its centre in those of the world.
  Eigen::Matrix<double, 6, 6> of_camera = Eigen::Matrix<double, 6, 6>::Identity();
  of_camera.bottomRightCorner<3, 3>() = turn;
  for (auto& [frame, covariance] : model.camera_covariances) {
    covariance = of_camera * covariance * of_camera.transpose();
  }
  return model;
}

RefinedModel RefineModel(const ColmapModel& model,
                         const fs::path& path,
                         Sequence& sequence,
                         const RefineModelOptions& options,
                         const StageProgress& progress) {
  // Even the points of a model that did not move improve, because in the second round their
  // templates use all sightings.
  constexpr int kLeastRounds = 2;
  constexpr int kMostRounds = 3;
  SecondPassOptions measurement = options.second_pass;
  measurement.measurement.patch.max_distance_px = options.model_max_distance_px;
  RefinedModel refined;
  sequence.Rewind();
  refined.frames = ReadFrames(sequence, "read", progress).frames;
  ModelOfClip clip = ReadModelOfClip(model, refined.frames, path);
  refined.image_ids = clip.image_ids;
  NoteWhatIsLeftOut(clip, path, sequence, refined.notes);
  if (clip.reconstruction.points.empty()) {
    ThrowError("{}: none of its points is observed in {}", path.string(), sequence.Name());
  }
  CheckCountsAlike(model, clip, sequence, path, progress);
  refined.before = Summarize(clip.reconstruction, clip.file.FrameCount());
  Reconstruction now = clip.reconstruction;
  now.camera.row_order = sequence.SensorRows();
  now.camera.known =
      options.intrinsics == IntrinsicsMode::kKeep ||
      (options.intrinsics == IntrinsicsMode::kAuto && !IsFoundByColmap(FirstCameraOf(model).model));
  MapperOptions ceres = options.ceres;
  if (FirstCameraOf(model).model == ColmapCameraModel::kSimplePinhole) ceres.refine_radial = false;
  MapperOptions with_covariances = ceres;
  ceres.covariances = false;
  refined.file = clip.file;
  NoteSensorRows(sequence, refined.file);
  for (int round = 0; round < kMostRounds; ++round) {
    SecondPass second = MeasureAgain(refined.file, now, sequence, measurement, progress);
    if (round == 0) {
      CheckFound(second.figures, path, sequence);
      refined.found = second.figures;
    }
    refined.file = std::move(second.file);
    MapperResult adjusted = AdjustAndJudgeWithCeres(refined.file, now, ceres);
    if (adjusted.better_camera && options.intrinsics == IntrinsicsMode::kAuto) {
      refined.notes.push_back(
          fmt::format("{}: the tracks contradict its camera, which is therefore refined: "
                      "--intrinsics keep prevents this",
                      path.string()));
      adjusted.reconstruction.camera.known = false;
      adjusted = AdjustAndJudgeWithCeres(refined.file, adjusted.reconstruction, ceres);
    }
    adjusted = InWorldOf(clip.reconstruction, std::move(adjusted));
    const bool moved = HaveMoved(std::span(&now, 1), adjusted.reconstruction, measurement);
    now = std::move(adjusted.reconstruction);
    CheckPointsAreLeft(now, refined.before, path);
    if (!moved && round + 1 >= kLeastRounds) break;
  }
  if (options.drop_contradicted) {
    const std::set<FeatureId> contradicted = FindContradicted(refined.file.tracks, now);
    refined.contradicted = contradicted.size();
    refined.file.tracks = refined.file.tracks.Select(
        [&](FeatureId feature) { return !contradicted.contains(feature); });
  }
  refined.adjusted = ToReconstructResult(
      InWorldOf(clip.reconstruction, AdjustAndJudgeWithCeres(refined.file, now, with_covariances)));
  CheckPointsAreLeft(refined.adjusted.reconstruction, refined.before, path);
  refined.camera_refined = !now.camera.known && (ceres.refine_focal || ceres.refine_radial ||
                                                 ceres.refine_principal_point);
  refined.model =
      ReplaceInModel(model, clip, refined.adjusted.reconstruction, refined.camera_refined);
  refined.file.camera = refined.adjusted.reconstruction.camera;
  // Its poses fit no other camera. If the focal length changes, the tracks only have the first
  // guess.
  refined.file.camera->known = refined.adjusted.reconstruction.focal_scale.empty();
  return refined;
}

RefinedModel RefineModelIntoFolder(const fs::path& model,
                                   Sequence& sequence,
                                   const std::string& source,
                                   const std::string& mask,
                                   const RefineModelOptions& options,
                                   const fs::path& folder,
                                   const StageProgress& progress) {
  std::vector<std::string> names = ModelFolderNames();
  names.emplace_back(kTracksName);
  OutputFolder out(folder, names, IsOurModelFolder);
  RefinedModel refined = RefineModel(ReadColmapModel(model), model, sequence, options, progress);
  NoteMask(mask, refined.file);
  refined.file.source = AbsolutePath(source);
  refined.file.image_root = AbsolutePath(sequence.ImageRoot());
  refined.file.meta.imported_from = AbsolutePath(model);
  refined.file.meta.tracker = "import";
  WriteReconstructionFiles(out.partial(), refined.adjusted.reconstruction, refined.model);
  WriteCeresFindings(*refined.adjusted.ceres, refined.file, out.partial());
  WriteTrackFile(out.partial() / kTracksName, refined.file);
  WriteJsonFile(out.partial() / "summary.json", SummaryToJson(refined, model, options));
  out.Commit();
  return refined;
}

}  // namespace cohort
