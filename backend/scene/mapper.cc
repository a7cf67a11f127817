#include "backend/scene/mapper.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "backend/scene/judgement.h"
#include "backend/scene/parts.h"
#include "frontend/core/stopwatch.h"

namespace cohort {
namespace {

// Parallax after which a frame takes part in growing the model [px], and how many are to do so at
// least. Chosen by eye on the tuning clips.
constexpr double kKeyframeParallaxPx = 10.0;
constexpr int kMinKeyframes = 10;

Camera CameraOrGuess(const TrackFile& file) {
  if (file.width_px <= 0 || file.height_px <= 0) {
    ThrowError("the tracks do not say the picture size ({} x {} px): import them with --images",
               file.width_px,
               file.height_px);
  }
  if (!file.camera) return Camera::Guess(file.width_px, file.height_px);
  const Camera& c = *file.camera;
  for (const double value :
       {c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, c.k3, c.k4, c.k5, c.k6}) {
    if (!std::isfinite(value)) ThrowError("the tracks' camera has a parameter that is not finite");
  }
  if (!(c.fx > 0.0 && c.fy > 0.0)) {
    ThrowError("the tracks' camera has focal lengths {}, {} px: they must be positive", c.fx, c.fy);
  }
  return c;
}

CameraRefinement RefinementOf(const Camera& camera, const MapperOptions& options) {
  if (camera.known) return {};
  return {options.refine_focal, options.refine_radial, options.refine_principal_point};
}

WhiteningOptions WhiteningOptionsFrom(const MapperOptions& options) {
  WhiteningOptions result;
  result.min_track_length = options.min_track_length;
  result.use_covariances = options.use_covariances;
  result.covariance_floor_px = options.covariance_floor_px;
  result.include_predicted = options.include_predicted;
  result.predicted_growth_px = options.predicted_growth_px;
  return result;
}

Reconstruction ToReconstruction(const WorkingModel& model) {
  const WhitenedTracks& whitened = model.whitened();
  Reconstruction result;
  result.camera = model.camera();
  for (const int f : model.RegisteredFrames()) {
    const FrameInfo& info = whitened.frames()[f];
    result.cam_from_world[info.index] = model.Pose(f);
    result.frame_names[info.index] = info.name;
    result.timestamps_ns[info.index] = info.timestamp_ns;
  }
  for (int t = 0; t < whitened.track_count(); ++t) {
    if (!model.HasPoint(t)) continue;
    Point3D& point = result.points[whitened.features()[t]];
    point.in_world = model.Point(t);
    const auto [first, last] = whitened.TrackRange(t);
    for (int o = first; o < last; ++o) {
      if (!model.IsInlier(o)) continue;
      const WhitenedObservation& observation = whitened.observations()[o];
      point.views.push_back({whitened.frames()[observation.frame].index, observation.xy});
    }
  }
  UpdateReprojectionErrors(result);
  return result;
}

MapperResult WithEnd(MapperResult result, const MapperEnd& end) {
  result.termination = end.termination;
  result.summary.termination = std::string(NameOf(kMapperTerminationNames, end.termination));
  if (!end.detail.empty()) result.summary.termination += ": " + end.detail;
  return result;
}

// With what follows from the reconstruction: the summary's figures and the tracks without a point.
MapperResult WithSummary(MapperResult result, const TrackFile& file, const Stopwatch& stopwatch) {
  const ReconstructionSummary ended = std::move(result.summary);
  result.summary = Summarize(result.reconstruction, file.frames.size());
  result.summary.termination = ended.termination;
  result.summary.reasons.insert(
      result.summary.reasons.end(), ended.reasons.begin(), ended.reasons.end());
  result.summary.seconds = stopwatch.Seconds();
  for (const FeatureId feature : file.tracks.features()) {
    if (!result.reconstruction.points.contains(feature)) result.without_point.push_back(feature);
  }
  return result;
}

std::string DescribeBetterCamera(const Camera& better, const Camera& given) {
  return fmt::format(
      "the tracks contradict the camera given: they ask for fx {:.1f} instead of {:.1f} px and k1 "
      "{:.3f}, k2 {:.3f} instead of {:.3f}, {:.3f}",
      better.fx,
      given.fx,
      better.k1,
      better.k2,
      given.k1,
      given.k2);
}

// What there is to doubt of a model that is returned: a sentence each.
std::vector<std::string> DoubtModel(const MapperResult& result,
                                    const WorkingModel& model,
                                    const Camera& camera) {
  std::vector<std::string> doubts;
  if (!result.other_parts.empty()) {
    doubts.push_back(fmt::format(
        "the clip breaks into {} parts, this is the largest: film what lies between them slower",
        result.other_parts.size() + 1));
  }
  if (result.better_camera) {
    doubts.push_back(DescribeBetterCamera(*result.better_camera, camera));
  } else if (std::string noise = DescribeExcessNoise(model, camera.known); !noise.empty()) {
    // Refined from a camera that is far off, the better one may not be found.
    doubts.push_back(std::move(noise));
  }
  return doubts;
}

// All but the summary's figures.
MapperResult MapTracks(const TrackFile& file, const MapperOptions& options) {
  MapperResult result;
  const Camera camera = CameraOrGuess(file);
  if (file.frames.size() < 2) {
    return WithEnd(
        std::move(result),
        {MapperTermination::kTooFewTracks,
         fmt::format("the clip has {} frame, at least 2 are needed", file.frames.size())});
  }
  const WhitenedTracks whitened(file, WhiteningOptionsFrom(options));
  if (whitened.track_count() == 0) {
    return WithEnd(std::move(result),
                   {MapperTermination::kTooFewTracks,
                    fmt::format("none of {} tracks is observed in {} frames",
                                file.tracks.features().size(),
                                options.min_track_length)});
  }

  const CameraRefinement refinement = RefinementOf(camera, options);
  const std::vector<int> keyframes =
      SelectKeyframes(whitened, camera, kKeyframeParallaxPx, kMinKeyframes);
  PartResult first = MapPart(whitened, camera, refinement, keyframes);
  if (!first.model) return WithEnd(std::move(result), first.end);
  std::vector<WorkingModel> parts =
      MapRemainingParts(std::move(*first.model), camera, refinement, keyframes);
  for (WorkingModel& part : parts) {
    AdjustUntilSettled(part, refinement, 3, 4);
    part.Normalise();
  }
  // The largest part of worth is the model.
  std::vector<Judgement> judgements;
  for (const WorkingModel& part : parts) judgements.push_back(JudgeModel(part, camera, keyframes));
  const auto worth = std::find_if(
      judgements.begin(), judgements.end(), [](const auto& j) { return !j.worthless; });
  const Judgement& judgement = worth == judgements.end() ? judgements.front() : *worth;
  result.depth_uncertainty = judgement.depth_uncertainty;
  result.unexplained_parallax = judgement.unexplained_parallax;
  if (worth == judgements.end()) {
    return WithEnd(std::move(result), *judgements.front().worthless);
  }
  const auto chosen = worth - judgements.begin();
  for (std::size_t i = static_cast<std::size_t>(chosen) + 1; i < parts.size(); ++i) {
    if (!judgements[i].worthless) result.other_parts.push_back(ToReconstruction(parts[i]));
  }
  WorkingModel& model = parts[static_cast<std::size_t>(chosen)];
  result.noise = model.noise();
  if (camera.known) result.better_camera = FindBetterCamera(model, keyframes);
  std::vector<std::string>& reasons = result.summary.reasons;
  reasons = std::move(first.doubts);
  reasons.insert(reasons.end(), judgement.doubts.begin(), judgement.doubts.end());
  for (std::string& doubt : DoubtModel(result, model, camera)) reasons.push_back(std::move(doubt));
  if (options.covariances) {
    if (auto covariances = AdjustWithCovariances(model, refinement)) {
      result.camera_covariances = std::move(covariances->cameras);
      result.point_covariances = std::move(covariances->points);
    } else {
      result.warnings.emplace_back(
          "covariances could not be estimated: the problem is rank deficient");
    }
  }
  result.reconstruction = ToReconstruction(model);
  const bool partial =
      TooFewRegistered(static_cast<std::size_t>(model.registered()), file.frames.size());
  return WithEnd(std::move(result),
                 {partial ? MapperTermination::kPartial : MapperTermination::kSuccess,
                  fmt::format("{}", fmt::join(result.summary.reasons, "; "))});
}

}  // namespace

MapperResult ReconstructWithCeres(const TrackFile& file, const MapperOptions& options) {
  ValidateOptions(options);
  const Stopwatch stopwatch;
  return WithSummary(MapTracks(file, options), file, stopwatch);
}

MapperResult TriangulateWithCeres(const TrackFile& file,
                                  const std::map<FrameIndex, Rigid3>& cam_from_world,
                                  const MapperOptions& options) {
  ValidateOptions(options);
  if (!file.camera || !file.camera->known) {
    ThrowError("triangulation with given poses needs a known camera: give --camera");
  }
  constexpr int kRounds = 3;
  const Stopwatch stopwatch;
  const WhitenedTracks whitened(file, WhiteningOptionsFrom(options));
  WorkingModel model(whitened, CameraOrGuess(file));
  for (int frame = 0; frame < whitened.frame_count(); ++frame) {
    const auto pose = cam_from_world.find(whitened.frames()[frame].index);
    if (pose != cam_from_world.end()) model.SetPose(frame, pose->second);
  }
  model.TriangulateAllTracks();
  model.UpdateAllInliers(std::numeric_limits<double>::infinity());
  for (int round = 0; round < kRounds; ++round) {
    AdjustPoints(model);
    model.UpdateAllInliers(model.ErrorBound());
    model.TriangulateAllTracks();
  }

  MapperResult result;
  result.reconstruction = ToReconstruction(model);
  result.noise = model.noise();
  result.summary.termination = "triangulated with given poses";
  result = WithSummary(std::move(result), file, stopwatch);
  result.termination =
      result.summary.Failed() ? MapperTermination::kPartial : MapperTermination::kSuccess;
  return result;
}

}  // namespace cohort
