#include "backend/mapper/mapper.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "backend/adjust/lens_changes.h"
#include "backend/adjust/rolling_shutter.h"
#include "backend/grow/grown_parts.h"
#include "backend/grow/parts.h"
#include "backend/judge/aside.h"
#include "backend/judge/doubts.h"
#include "backend/mapper/camera_search.h"
#include "backend/scene/near_world.h"
#include "backend/scene/phrasebook.h"
#include "backend/scene/row_poses.h"
#include "backend/scene/spread_tracks.h"
#include "frontend/core/part_times.h"
#include "frontend/core/stopwatch.h"
#include "frontend/geometry/sim3.h"

namespace cohort {
namespace {

constexpr int kMostFramesWithCovariances = 600;  // memory grows with their square

Camera CameraOrGuess(const TrackFile& file) {
  if (file.width_px <= 0 || file.height_px <= 0) {
    ThrowError("the tracks have no valid picture size ({} x {} px): import them with --images",
               file.width_px,
               file.height_px);
  }
  Camera c = file.camera.value_or(Camera::Guess(file.width_px, file.height_px));
  c.row_order = file.meta.row_order;
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
  return {options.refine_focal,
          options.refine_radial,
          options.refine_principal_point,
          camera.fx,
          camera.guess_log_sigma};
}

// The camera with which the search begins; nullopt if fewer parameters are refined than when it was
// found.
std::optional<Camera> FoundBefore(const TrackFile& file,
                                  const Camera& given,
                                  const CameraRefinement& refinement) {
  if (!refinement.focal || !refinement.radial || !refinement.principal_point) return std::nullopt;
  std::optional<Camera> found = file.found_camera;
  if (found) found->row_order = given.row_order;
  return found;
}

// `observed`: the model's tracks at their original positions in the pictures.
Reconstruction ToReconstruction(const WorkingModel& model,
                                const WhitenedTracks& observed,
                                double readout) {
  const WhitenedTracks& whitened = model.whitened();
  Reconstruction result;
  result.camera = model.camera();
  result.readout = readout;
  result.frame_times = whitened.frame_times();
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
      const WhitenedObservation& observation = observed.observations()[o];
      point.views.push_back({whitened.frames()[observation.frame].index, observation.xy});
    }
  }
  UpdateReprojectionErrors(result);
  return result;
}

MapperResult WithEnd(MapperResult result, const MapperEnd& end) {
  result.termination = end.termination;
  result.summary.termination = TerminationLine(end);
  return result;
}

// Adds what follows from the reconstruction: the summary's figures and the tracks without a point.
MapperResult WithSummary(MapperResult result, const TrackFile& file, const Stopwatch& stopwatch) {
  const ReconstructionSummary ended = std::move(result.summary);
  NoteFrames(file, result.reconstruction);
  for (Reconstruction& part : result.other_parts) NoteFrames(file, part);
  result.summary = SummarizeModelOf(file, result.reconstruction);
  result.summary.termination = ended.termination;
  result.summary.reasons.insert(
      result.summary.reasons.end(), ended.reasons.begin(), ended.reasons.end());
  result.summary.seconds = stopwatch.Seconds();
  for (const FeatureId feature : file.tracks.features()) {
    if (!result.reconstruction.points.contains(feature)) result.without_point.push_back(feature);
  }
  return result;
}

// The parts of a clip and their judgements, in the same order.
struct JudgedParts {
  std::vector<WorkingModel> parts;
  std::vector<Judgement> judgements = {};
  std::size_t chosen = 0;  // the largest part that is not worthless; if all are, the largest
  double readout = 0.0;
  std::vector<WhitenedTracks> corrected = {};  // the parts' tracks, corrected for a rolling shutter
};

// Adjusts the parts, which share a camera and thus a readout, which is estimated from the largest.
// A guessed camera is kept fixed until then: small effects that bend a model (a rolling shutter,
// drifting tracks) bend the focal length first.
void AdjustParts(const MapperOptions& options,
                 const CameraRefinement& refinement,
                 JudgedParts& judged) {
  WorkingModel& largest = judged.parts.front();
  const WhitenedTracks& observed = largest.whitened();
  judged.corrected.assign(judged.parts.size(), observed);
  judged.readout = options.readout;
  std::optional<ReadoutEstimate> rolling;
  if (options.readout == 0.0 && options.estimate_readout) {
    const ReadoutEstimate estimate = EstimateReadout(observed, largest, judged.corrected.front());
    if (estimate.IsRolling()) {
      rolling = estimate;
      judged.readout = estimate.readout;
    }
    spdlog::debug("readout {:.4f} +- {:.4f}", estimate.readout, estimate.sigma);
  }
  for (std::size_t i = 0; i < judged.parts.size(); ++i) {
    WorkingModel& model = judged.parts[i];
    if (judged.readout != 0.0) {
      AdjustToReadout(observed, judged.readout, model, judged.corrected[i]);
      AdjustUntilSettled(model, 3, 4);
    }
    // The camera of the search is good enough to predict features, except with a rolling shutter.
    if (refinement.Any() && (!options.draft || judged.readout != 0.0)) {
      AdjustCamera(model, refinement);
      if (i == 0 && rolling) {
        judged.readout = RefineReadout(observed, *rolling, model, judged.corrected[i]);
      }
    }
    if (judged.readout != 0.0) {
      AdjustToReadout(observed, judged.readout, model, judged.corrected[i]);
    }
    if (judged.readout != 0.0 && refinement.Any()) AdjustCamera(model, refinement);
    if (!options.draft) AdjustToMinimum(model);
    model.RemoveUnsupportedPoses();
    model.Normalise();
  }
}

JudgedParts JudgeParts(std::vector<WorkingModel> parts,
                       const Camera& camera,
                       const MapperOptions& options,
                       const CameraRefinement& refinement,
                       const std::vector<int>& keyframes) {
  JudgedParts judged{.parts = std::move(parts)};
  AdjustParts(options, refinement, judged);
  for (const WorkingModel& part : judged.parts) {
    judged.judgements.push_back(JudgeModel(part, camera, keyframes));
  }
  const auto worth = std::find_if(judged.judgements.begin(),
                                  judged.judgements.end(),
                                  [](const Judgement& j) { return !j.worthless; });
  if (worth != judged.judgements.end()) {
    judged.chosen = static_cast<std::size_t>(worth - judged.judgements.begin());
  }
  return judged;
}

// Adds the covariances of an adjusted model, and what they say of its cameras and focal length; a
// warning if there are none.
void AddCovariances(const WorkingModel& model,
                    const CameraRefinement& refinement,
                    MapperResult& result) {
  if (model.registered() > kMostFramesWithCovariances) {
    result.warnings.push_back(fmt::format(
        "more than {} frames: the covariances and the expected error of the cameras are "
        "not estimated",
        kMostFramesWithCovariances));
    return;
  }
  auto found = CovariancesAtOptimum(model, refinement);
  if (!found) {
    result.warnings.emplace_back(
        "covariances could not be estimated: the problem is rank deficient");
    return;
  }
  if (found->focal) result.focal_sigma = kFocalErrorOverNoise * *found->focal;
  double sum = 0.0;
  for (const auto& [frame, deviation] : found->centers) sum += deviation * deviation;
  result.expected_error =
      kCameraErrorOverNoise *
      std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, found->centers.size())));
  spdlog::debug("expected error: {:.4f} %, focal sigma {:.3f} %",
                100.0 * *result.expected_error,
                100.0 * result.focal_sigma.value_or(0.0));
  result.camera_covariances = std::move(found->cameras);
  result.point_covariances = std::move(found->points);
}

// What the mapper works with before it judges a model.
struct Search {
  const TrackFile& file;
  const WhitenedTracks& observed;  // the tracks at their original positions in the pictures
  const MapperOptions& options;
  CameraRefinement refinement;
  Camera camera;                // with which the model was grown
  std::optional<Camera> rival;  // FoundCamera::rival
  std::vector<int> keyframes;
};

// Adds the chosen part: the model itself, what is found about it, and the doubts.
MapperResult WithModel(MapperResult result, const Search& search, const JudgedParts& judged) {
  const WorkingModel& model = judged.parts[judged.chosen];
  const Judgement& judgement = judged.judgements[judged.chosen];
  const bool complete = !search.options.draft;
  result.depth_uncertainty = judgement.depth_uncertainty;
  result.unexplained_parallax = judgement.unexplained_parallax;
  result.noise = model.noise();
  if (search.refinement.Any() || complete) {
    result.lens_changes = MeasureLensChanges(model, search.refinement);
  }
  if (search.camera.known && complete) {
    result.better_camera = FindBetterCamera(model, search.keyframes);
  }
  if (search.options.covariances && complete) AddCovariances(model, search.refinement, result);
  result.reconstruction = ToReconstruction(model, search.observed, judged.readout);
  result.summary.reasons = DoubtsOf({.file = search.file,
                                     .parts = judged.parts,
                                     .chosen = judged.chosen,
                                     .judgement = judgement,
                                     .reconstruction = result.reconstruction,
                                     .camera = search.camera,
                                     .rival = search.rival,
                                     .better_camera = result.better_camera,
                                     .expected_error = result.expected_error,
                                     .focal_sigma = result.focal_sigma,
                                     .lens_changes = result.lens_changes});
  return result;
}

MapperResult WithEndOfModel(MapperResult described, const TrackFile& file) {
  NoteFrames(file, described.reconstruction);
  const ReconstructionSummary summary = SummarizeModelOf(file, described.reconstruction);
  if (!summary.Failed()) return WithEnd(std::move(described), {MapperTermination::kSuccess, ""});
  return WithEnd(std::move(described), {MapperTermination::kPartial, ""});
}

bool HasNeighbours(const std::vector<FrameInfo>& frames) {
  return std::ranges::adjacent_find(frames, [](const FrameInfo& a, const FrameInfo& b) {
           return ToInt(b.index) - ToInt(a.index) <= kMostFramesApart;
         }) != frames.end();
}

// Everything except the summary's figures, with one focal length for all frames.
MapperResult MapAtOneFocalLength(const TrackFile& file, const MapperOptions& options) {
  MapperResult result;
  const Camera given = CameraOrGuess(file);
  const auto least = static_cast<std::size_t>(std::max(2, options.whitening.min_track_length));
  if (file.frames.size() < least) {
    return WithEnd({}, TooFewFramesEnd(file.frames.size(), least));
  }
  const WhitenedTracks whitened(file, options.whitening);
  if (whitened.track_count() == 0) {
    return WithEnd(
        {}, TracksTooShortEnd(file.tracks.features().size(), options.whitening.min_track_length));
  }

  if (options.readout != 0.0 && !HasNeighbours(file.frames)) {
    result.warnings.push_back(
        fmt::format("the readout of {:g} has no effect: no two frames are {:g} or less apart, so "
                    "the motion of the camera within a frame is unknown",
                    options.readout,
                    kMostFramesApart));
  }
  const CameraRefinement refinement = RefinementOf(given, options);
  const std::optional<Camera> found_before = FoundBefore(file, given, refinement);
  Camera camera = found_before.value_or(given);
  std::vector<int> keyframes = SelectKeyframes(whitened, camera);
  std::optional<FoundCamera> found;
  if (refinement.focal) {
    if ((found = SearchCamera(whitened, given, found_before, refinement, keyframes))) {
      camera = found->camera;
      keyframes = SelectKeyframes(whitened, camera);
    }
  }
  GrownParts grown = found && found->grown ? std::move(*found->grown)
                                           : GrowPartsBySome(whitened, camera, keyframes);
  if (grown.parts.empty()) return WithEnd(std::move(result), grown.end);
  for (WorkingModel& part : grown.parts) AdjustUntilSettled(part, 4, 4);
  JudgedParts judged = JudgeParts(std::move(grown.parts), given, options, refinement, keyframes);
  const Judgement& judgement = judged.judgements[judged.chosen];
  if (judgement.worthless) {
    result.depth_uncertainty = judgement.depth_uncertainty;
    result.unexplained_parallax = judgement.unexplained_parallax;
    return WithEnd(std::move(result), *judgement.worthless);
  }
  for (std::size_t i = judged.chosen + 1; i < judged.parts.size(); ++i) {
    if (judged.judgements[i].worthless) continue;
    result.other_parts.push_back(ToReconstruction(judged.parts[i], whitened, judged.readout));
  }
  const std::optional<Camera> rival = found ? found->rival : std::nullopt;
  const Search search{file, whitened, options, refinement, camera, rival, std::move(keyframes)};
  return WithEndOfModel(WithModel(std::move(result), search, judged), file);
}

void SetPoses(const std::map<FrameIndex, Rigid3>& cam_from_world, WorkingModel& model) {
  const std::vector<FrameInfo>& frames = model.whitened().frames();
  for (std::size_t frame = 0; frame < frames.size(); ++frame) {
    const auto pose = cam_from_world.find(frames[frame].index);
    if (pose != cam_from_world.end()) model.SetPose(static_cast<int>(frame), pose->second);
  }
}

// The poses of `start` and new points, then all adjusted together, with the camera fixed.
WorkingModel AdjustedModel(const WhitenedTracks& whitened, const Reconstruction& start) {
  WorkingModel model(whitened, start.camera);
  SetPoses(start.cam_from_world, model);
  model.TriangulateAllTracks();
  AdjustUntilSettled(model, 4, 5);
  return model;
}

// Everything except the summary's figures, from a model of the clip, with one focal length for all
// frames.
MapperResult AdjustAtOneFocalLength(const TrackFile& file,
                                    const Reconstruction& start,
                                    const CameraRefinement& refinement,
                                    const MapperOptions& options) {
  const WhitenedTracks whitened(file, options.whitening);
  const NearModel near(start);
  JudgedParts judged{.parts = {AdjustedModel(whitened, near.get())}};
  AdjustParts(options, refinement, judged);
  const WorkingModel& model = judged.parts.front();
  const Search search{file,
                      whitened,
                      options,
                      refinement,
                      start.camera,
                      std::nullopt,
                      SelectKeyframes(whitened, model.camera())};
  judged.judgements = {JudgeModel(model, start.camera, search.keyframes)};
  return WithEndOfModel(WithModel({}, search, judged), file);
}

// The clip as a camera that does not zoom would have seen it.
TrackFile AtOneFocalLength(const TrackFile& file, const Camera& camera, const FocalScales& scales) {
  TrackFile at_one = file;
  at_one.tracks = AtOneFocalLength(file.tracks, camera, scales);
  return at_one;
}

// Converts a model of the tracks at one focal length to a model of `file`.
MapperResult WithFocalScales(MapperResult result,
                             const FocalScales& scales,
                             const TrackFile& file) {
  result.reconstruction.focal_scale = scales;
  MoveViewsToTracks(file.tracks, result.reconstruction.readout, result.reconstruction);
  result.summary.reasons.push_back(FoundZoomDoubt(ZoomOf(scales)));
  return WithEndOfModel(std::move(result), file);
}

// The model with the poses, the camera and the focal lengths that its tracks imply.
Reconstruction FollowLens(const LensChanges& changes, const FocalScales& before) {
  Reconstruction model;
  model.camera = changes.camera;
  model.cam_from_world = changes.cam_from_world;
  for (const auto& [frame, scale] : changes.focal) {
    model.focal_scale[frame] = FocalScaleOf(before, frame) * scale;
  }
  return model;
}

// Adjusts a model of a clip that zooms by alternation: everything but the focal lengths with all
// tracks, then everything with some tracks (MeasureLensChanges), until the noise no longer
// decreases.
MapperResult AdjustWithZoom(const TrackFile& file,
                            Reconstruction model,
                            const CameraRefinement& refinement,
                            const MapperOptions& options) {
  constexpr int kMostRounds = 10;
  // The path to the minimum may follow a valley, where a round reduces the noise only a little.
  constexpr double kStays = 0.99;
  MapperResult adjusted;
  double noise = kInfinity;  // of the previous round
  for (int round = 0; round < kMostRounds; ++round) {
    if (round > 0) model = FollowLens(*adjusted.lens_changes, model.focal_scale);
    const FocalScales scales = std::exchange(model.focal_scale, {});
    adjusted = AdjustAtOneFocalLength(
        AtOneFocalLength(file, model.camera, scales), model, refinement, options);
    model.focal_scale = scales;
    if (!refinement.focal || !adjusted.lens_changes) break;
    spdlog::debug("zoom: f {:.1f}, noise {:.4f}, a zoom of {:.4f} is left",
                  adjusted.reconstruction.camera.fx,
                  adjusted.noise,
                  ZoomOf(adjusted.lens_changes->focal));
    if (adjusted.noise > kStays * noise) break;
    noise = adjusted.noise;
  }
  return WithFocalScales(std::move(adjusted), model.focal_scale, file);
}

bool Has(const ReconstructionSummary& summary, DoubtCode code) {
  return std::ranges::any_of(summary.reasons, [&](const Doubt& d) { return d.code == code; });
}

// Everything except the summary's figures. If the tracks imply a changing lens, and a focal length
// for each frame explains it, every frame gets its own.
MapperResult MapTracks(const TrackFile& file, const MapperOptions& options) {
  MapperResult result = MapAtOneFocalLength(file, options);
  const CameraRefinement refinement = RefinementOf(CameraOrGuess(file), options);
  if (!refinement.focal || !result.lens_changes || !result.lens_changes->IsChanging()) {
    return result;
  }
  MapperResult zoomed =
      AdjustWithZoom(file, FollowLens(*result.lens_changes, {}), refinement, options);
  const bool explained =
      zoomed.lens_changes && !zoomed.lens_changes->IsChanging() &&
      !Has(zoomed.summary, DoubtCode::kWorthless) &&
      zoomed.reconstruction.cam_from_world.size() >= result.reconstruction.cam_from_world.size();
  if (!explained) return result;
  // The adjustment of a single model cannot find these.
  zoomed.other_parts = std::move(result.other_parts);
  for (Doubt& doubt : result.summary.reasons) {
    if (doubt.code == DoubtCode::kParts) {
      zoomed.summary.reasons.push_back(std::move(doubt));
    }
  }
  return WithEndOfModel(std::move(zoomed), file);
}

}  // namespace

MapperResult ReconstructWithCeres(const TrackFile& file, const MapperOptions& options) {
  const TimedPart part("reconstruction");
  ValidateOptions(options);
  const Stopwatch stopwatch;
  return WithSummary(MapTracks(file, options), file, stopwatch);
}

Reconstruction AdjustWithCeres(const TrackFile& file, const Reconstruction& start) {
  const TimedPart part("reconstruction");
  const WhitenedTracks whitened(file, WhiteningOptions{});
  const NearModel near(start);
  return near.InWorldOfModel(ToReconstruction(AdjustedModel(whitened, near.get()), whitened, 0.0));
}

MapperResult AdjustAndJudgeWithCeres(const TrackFile& file,
                                     const Reconstruction& start,
                                     const MapperOptions& options) {
  ValidateOptions(options);
  const TimedPart part("reconstruction");
  const Stopwatch stopwatch;
  const CameraRefinement refinement = RefinementOf(start.camera, options);
  return WithSummary(start.focal_scale.empty()
                         ? AdjustAtOneFocalLength(file, start, refinement, options)
                         : AdjustWithZoom(file, start, refinement, options),
                     file,
                     stopwatch);
}

MapperResult TriangulateWithCeres(const TrackFile& file,
                                  const std::map<FrameIndex, Rigid3>& cam_from_world,
                                  const MapperOptions& options) {
  ValidateOptions(options);
  if (!file.KnowsCamera()) {
    ThrowError("triangulation with given poses needs a known camera: give --camera");
  }
  constexpr int kRounds = 3;
  const Stopwatch stopwatch;
  const WhitenedTracks whitened(file, options.whitening);
  WorkingModel model(whitened, CameraOrGuess(file));
  Reconstruction given;
  given.cam_from_world = cam_from_world;
  const NearModel near(given);
  SetPoses(near.get().cam_from_world, model);
  model.TriangulateAllTracks();
  model.UpdateAllInliers(std::numeric_limits<double>::infinity());
  for (int round = 0; round < kRounds; ++round) {
    AdjustPoints(model);
    model.UpdateAllInliers(model.ErrorBound());
    model.TriangulateAllTracks();
  }

  MapperResult result;
  result.reconstruction = ToReconstruction(model, whitened, 0.0);
  if (near.IsMoved()) {
    result.reconstruction = near.InWorldOfModel(std::move(result.reconstruction));
    // The given poses are kept exactly, without the rounding of the conversion to and fro.
    for (auto& [frame, pose] : result.reconstruction.cam_from_world) {
      pose = cam_from_world.at(frame);
    }
  }
  result.noise = model.noise();
  result.summary.termination = "triangulated with given poses";
  result = WithSummary(std::move(result), file, stopwatch);
  result.termination =
      result.summary.Failed() ? MapperTermination::kPartial : MapperTermination::kSuccess;
  return result;
}

}  // namespace cohort
