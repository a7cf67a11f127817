#include "backend/scene/mapper.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <span>
#include <utility>

#include "backend/scene/growth.h"
#include "backend/scene/judgement.h"
#include "backend/scene/near_world.h"
#include "backend/scene/parts.h"
#include "backend/scene/rolling_shutter.h"
#include "backend/scene/row_poses.h"
#include "backend/scene/spread_tracks.h"
#include "frontend/core/part_times.h"
#include "frontend/core/stopwatch.h"
#include "frontend/geometry/sim3.h"

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
  Camera c = file.camera.value_or(Camera::Guess(file.width_px, file.height_px));
  c.row_order = RowOrderOf(file);
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

// `observed`: the model's tracks as the pictures show them.
Reconstruction ToReconstruction(const WorkingModel& model,
                                const WhitenedTracks& observed,
                                double readout) {
  const WhitenedTracks& whitened = model.whitened();
  Reconstruction result;
  result.camera = model.camera();
  result.readout = readout;
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

Doubt DescribeBetterCamera(const Camera& better, const Camera& given) {
  std::string sentence = fmt::format(
      "the tracks contradict the camera given: they ask for fx {:.1f} instead of {:.1f} px and k1 "
      "{:.3f}, k2 {:.3f} instead of {:.3f}, {:.3f}: give another --camera, or none",
      better.fx,
      given.fx,
      better.k1,
      better.k2,
      given.k1,
      given.k2);
  return {DoubtCode::kCameraContradicted,
          std::move(sentence),
          {{"fx", better.fx},
           {"k1", better.k1},
           {"k2", better.k2},
           {"given_fx", given.fx},
           {"given_k1", given.k1},
           {"given_k2", given.k2}}};
}

// The parts of a clip, the largest first, adjusted by the camera given; or why there is none.
struct GrownParts {
  MapperEnd end = {};
  std::vector<MappedPart> parts = {};
};

GrownParts GrowParts(const WhitenedTracks& whitened,
                     const Camera& camera,
                     const GrowthOptions& growth,
                     const std::vector<int>& keyframes) {
  PartResult first = MapPart(whitened, camera, growth, keyframes);
  GrownParts grown;
  grown.end = first.end;
  if (!first.model) return grown;
  grown.parts = MapRemainingParts(std::move(first), camera, growth, keyframes);
  return grown;
}

// By far points too and, where those are many, by near ones alone as well (kNearRayAngleDeg): the
// parts whose largest fits the tracks better.
GrownParts GrowPartsBothWays(const WhitenedTracks& whitened,
                             const Camera& camera,
                             const CameraRefinement& refinement,
                             const std::vector<int>& keyframes) {
  // Of the inliers. Where far points had less, both ways gave about the same model on real clips, but
  // of a hand that turns the camera, where near ones alone were worse; where those lost the scale of
  // a drive, far points had a quarter.
  constexpr double kManyFarPoints = 0.05;
  GrownParts far = GrowParts(whitened, camera, {refinement, kFarRayAngleDeg}, keyframes);
  if (!far.parts.empty() && far.parts.front().model.ShareOfFarPoints() < kManyFarPoints) return far;
  GrownParts near = GrowParts(whitened, camera, {refinement, kNearRayAngleDeg}, keyframes);
  if (near.parts.empty()) return far;
  if (far.parts.empty()) return near;
  for (GrownParts* grown : {&far, &near}) AdjustUntilSettled(grown->parts.front().model, {}, 3, 4);
  const WorkingModel& by_far = far.parts.front().model;
  const WorkingModel& by_near = near.parts.front().model;
  std::vector<int> frames(whitened.frame_count());
  std::iota(frames.begin(), frames.end(), 0);
  const ComparedCosts costs = CompareCosts(by_near, by_far, frames);
  spdlog::debug("grown by near points {} frames, cost {:.1f}; by far ones {}, {:.1f}",
                by_near.registered(),
                costs.a,
                by_far.registered(),
                costs.b);
  return costs.a <= costs.b ? std::move(near) : std::move(far);
}

// Have all keyframes a pose in one part, which is the only scene that explains its start and most of
// the parallax?
bool IsSure(const GrownParts& grown, const std::vector<int>& keyframes) {
  // Of a hand that turns the camera fast, where half the tracks made a model of twice the error, they
  // left 0.5 to 0.7; of other clips, 0.01 to 0.26.
  constexpr double kMostUnexplained = 0.4;
  if (grown.parts.size() != 1 || !grown.parts.front().doubts.empty()) return false;
  const WorkingModel& model = grown.parts.front().model;
  return std::all_of(
             keyframes.begin(), keyframes.end(), [&](int frame) { return model.HasPose(frame); }) &&
         UnexplainedParallax(model, keyframes) <= kMostUnexplained;
}

// By all tracks, settled.
GrownParts GrowPartsByAll(const WhitenedTracks& whitened,
                          const Camera& camera,
                          const CameraRefinement& refinement,
                          const std::vector<int>& keyframes) {
  GrownParts grown = GrowPartsBothWays(whitened, camera, refinement, keyframes);
  for (MappedPart& part : grown.parts) AdjustUntilSettled(part.model, {}, 3, 4);
  return grown;
}

// Grown by some of the tracks, which takes so much less time, and then with all of them; where some
// are not enough, or there is a seam, by all.
GrownParts GrowPartsBySome(const WhitenedTracks& whitened,
                           const Camera& camera,
                           const CameraRefinement& refinement,
                           const std::vector<int>& keyframes) {
  constexpr int kPerCell = 2;
  constexpr double kWorthIt = 0.75;
  if (whitened.HasSeam()) return GrowPartsByAll(whitened, camera, refinement, keyframes);
  const WhitenedTracks some = whitened.Select(SpreadTracks(whitened, camera, keyframes, kPerCell));
  if (static_cast<double>(some.observations().size()) <
      kWorthIt * static_cast<double>(whitened.observations().size())) {
    const GrownParts grown = GrowPartsBothWays(some, camera, refinement, keyframes);
    if (IsSure(grown, keyframes)) {
      WorkingModel model(whitened, grown.parts.front().model);
      model.SetMinRayAngle(kFarRayAngleDeg);
      model.TriangulateAllTracks();
      RegisterOtherFrames(model);
      GrownParts all;
      all.parts.push_back({std::move(model), {}});
      return all;
    }
  }
  return GrowPartsByAll(whitened, camera, refinement, keyframes);
}

// The parts of a clip and what is to be thought of them, in the same order.
struct JudgedParts {
  std::vector<MappedPart> parts;
  std::vector<Judgement> judgements = {};
  std::size_t chosen = 0;  // the largest of worth; if none is, the largest
  double readout = 0.0;
  std::vector<WhitenedTracks> corrected = {};  // the parts' tracks where the shutter rolls
};

// With all else. The focal length first: distortion would take its part while it is wrong.
void RefineCamera(const CameraRefinement& refinement, WorkingModel& model) {
  constexpr int kRounds = 5;  // of points that a wrong focal length made outliers
  const int rounds = refinement.focal ? kRounds : 0;
  for (int round = 0; round < rounds; ++round) AdjustAll(model, {.focal = true});
  AdjustUntilSettled(model, refinement, 6, 10);
}

// Adjusts the parts, all of one camera and so of one readout: the largest tells it. A guessed camera
// is held until then: what bends a model (a rolling shutter, tracks that drift) bends the focal
// length first, while it is small.
void AdjustParts(const MapperOptions& options,
                 const CameraRefinement& refinement,
                 JudgedParts& judged) {
  WorkingModel& largest = judged.parts.front().model;
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
    WorkingModel& model = judged.parts[i].model;
    if (judged.readout != 0.0) {
      AdjustToReadout(observed, judged.readout, {}, model, judged.corrected[i]);
      AdjustUntilSettled(model, {}, 3, 4);
    }
    if (refinement.Any()) {
      RefineCamera(refinement, model);
      if (i == 0 && rolling) {
        judged.readout = RefineReadout(observed, *rolling, model, judged.corrected[i]);
      }
    }
    if (judged.readout != 0.0) {
      AdjustToReadout(observed, judged.readout, refinement, model, judged.corrected[i]);
    }
    if (refinement.Any()) AdjustToOptimum(model, refinement);
    model.Normalise();
  }
}

JudgedParts JudgeParts(std::vector<MappedPart> parts,
                       const Camera& camera,
                       const MapperOptions& options,
                       const CameraRefinement& refinement,
                       const std::vector<int>& keyframes) {
  JudgedParts judged{.parts = std::move(parts)};
  AdjustParts(options, refinement, judged);
  for (const MappedPart& part : judged.parts) {
    judged.judgements.push_back(JudgeModel(part.model, camera, keyframes));
  }
  const auto worth = std::find_if(judged.judgements.begin(),
                                  judged.judgements.end(),
                                  [](const Judgement& j) { return !j.worthless; });
  if (worth != judged.judgements.end()) {
    judged.chosen = static_cast<std::size_t>(worth - judged.judgements.begin());
  }
  return judged;
}

// What there is to doubt of the model that is returned.
std::vector<Doubt> DoubtModel(const MapperResult& result,
                              const JudgedParts& judged,
                              const Camera& camera) {
  const WorkingModel& model = judged.parts[judged.chosen].model;
  std::vector<Doubt> doubts = judged.parts[judged.chosen].doubts;
  const std::vector<Doubt>& judged_doubts = judged.judgements[judged.chosen].doubts;
  doubts.insert(doubts.end(), judged_doubts.begin(), judged_doubts.end());
  if (judged.parts.size() > 1) {
    doubts.push_back(
        {DoubtCode::kParts,
         fmt::format("the clip breaks into {} parts, this is the largest{}: film what lies between "
                     "them slower or, where it is cut, give its scenes one by one",
                     judged.parts.size(),
                     judged.chosen > 0 ? " of worth" : ""),
         {{"parts", static_cast<double>(judged.parts.size())}}});
  }
  if (result.better_camera) {
    doubts.push_back(DescribeBetterCamera(*result.better_camera, camera));
  } else if (std::optional<Doubt> noise = DescribeExcessNoise(model, camera.known)) {
    // Refined from a camera that is far off, the better one may not be found.
    doubts.push_back(std::move(*noise));
  }
  return doubts;
}

// What there is to say of the chosen part, the model itself included, whose tracks the pictures
// show as `observed`.
void Describe(const JudgedParts& judged,
              const WhitenedTracks& observed,
              const Camera& camera,
              const CameraRefinement& refinement,
              const MapperOptions& options,
              const std::vector<int>& keyframes,
              MapperResult& result) {
  const WorkingModel& model = judged.parts[judged.chosen].model;
  result.noise = model.noise();
  if (camera.known) result.better_camera = FindBetterCamera(model, keyframes);
  result.summary.reasons = DoubtModel(result, judged, camera);
  const auto add_doubt = [&result](std::optional<Doubt> doubt) {
    if (doubt) result.summary.reasons.push_back(std::move(*doubt));
  };
  if (options.covariances) {
    if (auto covariances = CovariancesAtOptimum(model, refinement)) {
      spdlog::debug("focal length known to {:.2g}", covariances->focal.value_or(0.0));
      add_doubt(DescribeUncertainFocal(covariances->focal.value_or(0.0)));
      result.camera_covariances = std::move(covariances->cameras);
      result.point_covariances = std::move(covariances->points);
    } else {
      result.warnings.emplace_back(
          "covariances could not be estimated: the problem is rank deficient");
    }
  }
  result.reconstruction = ToReconstruction(model, observed, judged.readout);
  add_doubt(DescribeLine(result.reconstruction));
  const auto uncertainty = CameraUncertainty(result.camera_covariances, result.reconstruction);
  add_doubt(DescribeUncertainCameras(uncertainty.value_or(0.0)));
}

MapperEnd EndOfModel(const MapperResult& described, std::size_t frames) {
  const bool partial = TooFewRegistered(described.reconstruction.cam_from_world.size(), frames);
  return {partial ? MapperTermination::kPartial : MapperTermination::kSuccess,
          fmt::format("{}", fmt::join(SentencesOf(described.summary.reasons), "; "))};
}

bool HasNeighbours(const std::vector<FrameInfo>& frames) {
  return std::ranges::adjacent_find(frames, [](const FrameInfo& a, const FrameInfo& b) {
           return ToInt(b.index) - ToInt(a.index) <= kMostFramesApart;
         }) != frames.end();
}

// All but the summary's figures.
MapperResult MapTracks(const TrackFile& file, const MapperOptions& options) {
  MapperResult result;
  const Camera camera = CameraOrGuess(file);
  const auto least = static_cast<std::size_t>(std::max(2, options.min_track_length));
  if (file.frames.size() < least) {
    return WithEnd(std::move(result),
                   {MapperTermination::kTooFewTracks,
                    fmt::format("the clip has {} frame{}, at least {} are needed",
                                file.frames.size(),
                                file.frames.size() == 1 ? "" : "s",
                                least)});
  }
  const WhitenedTracks whitened(file, WhiteningOptionsFrom(options));
  if (whitened.track_count() == 0) {
    return WithEnd(std::move(result),
                   {MapperTermination::kTooFewTracks,
                    fmt::format("none of {} tracks is observed in {} frames",
                                file.tracks.features().size(),
                                options.min_track_length)});
  }

  if (options.readout != 0.0 && !HasNeighbours(file.frames)) {
    result.warnings.push_back(
        fmt::format("the readout of {:g} changes nothing: no two frames lie {:g} or less apart, so "
                    "that nothing is "
                    "known of how the camera moves within one",
                    options.readout,
                    kMostFramesApart));
  }
  const CameraRefinement refinement = RefinementOf(camera, options);
  const std::vector<int> keyframes =
      SelectKeyframes(whitened, camera, kKeyframeParallaxPx, kMinKeyframes);
  // A guessed focal length is held while the model grows; where nothing grows by it, it is not.
  GrownParts grown = GrowPartsBySome(whitened, camera, {}, keyframes);
  if (grown.parts.empty() && refinement.focal) {
    grown = GrowPartsBySome(whitened, camera, refinement, keyframes);
  }
  if (grown.parts.empty()) return WithEnd(std::move(result), grown.end);
  for (MappedPart& part : grown.parts) AdjustUntilSettled(part.model, {}, 4, 4);
  JudgedParts judged = JudgeParts(std::move(grown.parts), camera, options, refinement, keyframes);
  const Judgement& judgement = judged.judgements[judged.chosen];
  result.depth_uncertainty = judgement.depth_uncertainty;
  result.unexplained_parallax = judgement.unexplained_parallax;
  if (judgement.worthless) return WithEnd(std::move(result), *judgement.worthless);
  for (std::size_t i = judged.chosen + 1; i < judged.parts.size(); ++i) {
    if (judged.judgements[i].worthless) continue;
    result.other_parts.push_back(ToReconstruction(judged.parts[i].model, whitened, judged.readout));
  }
  Describe(judged, whitened, camera, refinement, options, keyframes, result);
  const MapperEnd end = EndOfModel(result, file.frames.size());
  return WithEnd(std::move(result), end);
}

void SetPoses(const std::map<FrameIndex, Rigid3>& cam_from_world, WorkingModel& model) {
  const std::vector<FrameInfo>& frames = model.whitened().frames();
  for (std::size_t frame = 0; frame < frames.size(); ++frame) {
    const auto pose = cam_from_world.find(frames[frame].index);
    if (pose != cam_from_world.end()) model.SetPose(static_cast<int>(frame), pose->second);
  }
}

// Poses of `start`, points anew, then all together but the camera.
WorkingModel AdjustedModel(const WhitenedTracks& whitened, const Reconstruction& start) {
  WorkingModel model(whitened, start.camera);
  SetPoses(start.cam_from_world, model);
  model.TriangulateAllTracks();
  AdjustUntilSettled(model, {}, 4, 5);
  return model;
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
  const WhitenedTracks whitened(file, WhiteningOptionsFrom({}));
  const NearModel near(start);
  return near.InWorldOfModel(ToReconstruction(AdjustedModel(whitened, near.get()), whitened, 0.0));
}

MapperResult AdjustAndJudgeWithCeres(const TrackFile& file,
                                     const Reconstruction& start,
                                     const MapperOptions& options) {
  ValidateOptions(options);
  const TimedPart part("reconstruction");
  const Stopwatch stopwatch;
  const WhitenedTracks whitened(file, WhiteningOptionsFrom(options));
  const NearModel near(start);
  JudgedParts judged{.parts = {{AdjustedModel(whitened, near.get()), {}}}};
  const CameraRefinement refinement = RefinementOf(start.camera, options);
  AdjustParts(options, refinement, judged);
  const WorkingModel& model = judged.parts.front().model;
  const std::vector<int> keyframes =
      SelectKeyframes(whitened, model.camera(), kKeyframeParallaxPx, kMinKeyframes);
  judged.judgements = {JudgeModel(model, start.camera, keyframes)};

  MapperResult result;
  if (const auto& worthless = judged.judgements.front().worthless) {
    judged.judgements.front().doubts.push_back(
        {DoubtCode::kWorthless,
         fmt::format("{}: {}",
                     NameOf(kMapperTerminationNames, worthless->termination),
                     worthless->detail)});
  }
  result.depth_uncertainty = judged.judgements.front().depth_uncertainty;
  result.unexplained_parallax = judged.judgements.front().unexplained_parallax;
  Describe(judged, whitened, start.camera, refinement, options, keyframes, result);
  const MapperEnd end = EndOfModel(result, file.frames.size());
  return WithSummary(WithEnd(std::move(result), end), file, stopwatch);
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
  const WhitenedTracks whitened(file, WhiteningOptionsFrom(options));
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
    // Kept: not even rounded by the way there and back.
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
