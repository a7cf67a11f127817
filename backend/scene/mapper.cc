#include "backend/scene/mapper.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <set>
#include <span>

#include "backend/scene/keyframes.h"
#include "backend/scene/start_models.h"
#include "backend/scene/working_model.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr int kMinKeyframes = 10;
constexpr int kMinCommonTracks = 12;
constexpr std::size_t kMaxStarts = 6;       // windows tried
constexpr std::size_t kMaxComponents = 20;  // of a clip that breaks
constexpr int kLocalFree = 4;               // frames that a local bundle adjustment moves
constexpr int kLocalFixed = 6;              // and neighbours that hold them
constexpr double kGlobalGrowth = 1.3;       // frames gained between global bundle adjustments
constexpr double kMinNoise = 0.02;          // of whitened residuals; less is no information
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Camera CameraOrGuess(const TrackFile& file) {
  if (file.width_px <= 0 || file.height_px <= 0) {
    ThrowError("the tracks do not say the picture size ({} x {} px): import them with --images",
               file.width_px,
               file.height_px);
  }
  if (!file.camera) return Camera::Guess(file.width_px, file.height_px);
  const Camera& c = *file.camera;
  for (const double value : {c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2}) {
    if (!std::isfinite(value)) ThrowError("the tracks' camera has a parameter that is not finite");
  }
  if (!(c.fx > 0.0 && c.fy > 0.0)) {
    ThrowError("the tracks' camera has focal lengths {}, {} px: they must be positive", c.fx, c.fy);
  }
  return c;
}

// A model of a part of the clip, or why there is none.
struct Mapped {
  MapperTermination termination = MapperTermination::kNoStart;
  std::string detail;
  std::optional<WorkingModel> model = std::nullopt;
};

class Mapper {
 public:
  Mapper(const WhitenedTracks& whitened, const Camera& camera, const MapperOptions& options)
      : whitened_(whitened), camera_(camera), options_(options) {
    model_options_.max_reprojection_px = options.max_reprojection_px;
    model_options_.min_angle_deg = options.min_angle_deg;
  }

  // Finds a start among these keyframes and grows it over them.
  Mapped Map(const std::vector<int>& keyframes) const {
    const std::vector<FramePairMotion> pairs =
        RankPairs(whitened_, camera_, keyframes, kMinCommonTracks);
    if (pairs.empty()) {
      return {MapperTermination::kTooFewTracks,
              fmt::format("no two frames share {} tracks", kMinCommonTracks)};
    }
    const double noise_px = EstimateNoise(whitened_);
    switch (ClassifyMotion(whitened_, camera_, pairs, noise_px)) {
      case ClipMotion::kStatic:
        return {MapperTermination::kStaticCamera,
                fmt::format("the tracks move by no more than their noise ({:.2f} px)", noise_px)};
      case ClipMotion::kRotation:
        return {MapperTermination::kPureRotation,
                "a rotation about the camera's centre explains all motion, so there is no depth"};
      case ClipMotion::kParallax:
        break;
    }
    std::vector<FramePairMotion> tried;
    for (const FramePairMotion& pair : pairs) {
      // A window much like one that failed would fail again.
      const bool similar = std::any_of(tried.begin(), tried.end(), [&](const auto& t) {
        const int overlap = std::min(t.frame_b, pair.frame_b) - std::max(t.frame_a, pair.frame_a);
        return overlap > 0.7 * (pair.frame_b - pair.frame_a) &&
               overlap > 0.7 * (t.frame_b - t.frame_a);
      });
      if (similar) continue;
      if (tried.size() == kMaxStarts) break;
      tried.push_back(pair);
      std::vector<StartModel> starts = Starts(pair);
      if (!starts.empty()) return GrowBest(std::move(starts), keyframes);
    }
    return WithoutModel(keyframes,
                        {MapperTermination::kNoStart,
                         fmt::format("there is parallax, but none of {} windows gave a consistent "
                                     "model",
                                     tried.size())});
  }

  // How a clip that moves and yet gave no model ends: where its motion is not that of a camera on
  // its way through a scene, so; otherwise as it is.
  Mapped WithoutModel(const std::vector<int>& keyframes, Mapped otherwise) const {
    const char* why =
        "if the camera moved, the tracks do not show it: they drift, or are on things "
        "that move";
    switch (ClassifyDrift(
        whitened_, camera_, RankPairs(whitened_, camera_, keyframes, kMinCommonTracks))) {
      case ClipMotion::kStatic:
        return {MapperTermination::kStaticCamera, why};
      case ClipMotion::kRotation:
        return {MapperTermination::kPureRotation,
                std::string("a rotation about the camera's centre explains most motion; ") + why};
      case ClipMotion::kParallax:
        break;
    }
    return otherwise;
  }

  // Poses for the frames between and beyond the keyframes.
  void Fill(WorkingModel& model) const {
    const std::vector<int> registered = model.RegisteredFrames();
    for (int f = registered.front() + 1; f < whitened_.frame_count(); ++f) {
      if (!model.HasPose(f)) Register(model, f);
    }
    for (int f = registered.front() - 1; f >= 0; --f) Register(model, f);
    model.TriangulateAllTracks();
  }

  // Bundle adjustment of everything, then of what the result agrees with, until little changes.
  // Later rounds start beside the optimum: half the iterations do.
  void Polish(WorkingModel& model, int max_rounds, int iterations) const {
    constexpr double kSettled = 2e-3;  // share of the observations
    model.UpdateAllInliers(kInfinity);
    for (int round = 0; round < max_rounds; ++round) {
      const ModelAdjustment adjustment =
          model.Adjust(model.RegisteredFrames(),
                       {},
                       Bundle(model, round == 0 ? iterations : std::max(2, iterations / 2), 1e-5));
      const int changes = model.UpdateAllInliers(model.ErrorBound());
      const int found = model.TriangulateAllTracks();
      spdlog::debug("{}; {} observations change sides, {} new points, noise {:.3f}",
                    adjustment.bundle.Brief(),
                    changes,
                    found,
                    model.noise());
      if (changes + found < kSettled * static_cast<double>(whitened_.observations().size())) break;
    }
  }

  BundleOptions Bundle(const WorkingModel& model, int max_iterations, double tolerance) const {
    BundleOptions bundle;
    bundle.loss = options_.loss;
    bundle.loss_scale = std::max(kMinNoise, options_.loss_scale * model.loss_turn());
    bundle.max_iterations = max_iterations;
    bundle.function_tolerance = tolerance;
    bundle.refine_focal = RefinesFocal();
    bundle.refine_radial = !camera_.known && options_.refine_radial;
    bundle.refine_principal_point = !camera_.known && options_.refine_principal_point;
    return bundle;
  }

  // How much of the parallax the model leaves unexplained: over the pairs of keyframes with most of
  // it, the median distance of the observations from the model's points, relative to that from the
  // best rotation. Small for a rigid scene; for what only looks like parallax, such as tracks that
  // drift each on its own, no depths and no path bring it far below 1.
  double UnexplainedParallax(const WorkingModel& model, const std::vector<int>& keyframes) const {
    std::vector<int> frames;
    for (const int f : keyframes) {
      if (model.HasPose(f)) frames.push_back(f);
    }
    std::vector<FramePairMotion> pairs =
        RankPairs(whitened_, model.camera(), frames, kMinCommonTracks);
    std::stable_sort(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) {
      return a.parallax_px > b.parallax_px;
    });
    constexpr std::size_t kPairs = 12;
    pairs.resize(std::min(pairs.size(), kPairs));
    std::vector<double> ratios;
    for (const FramePairMotion& pair : pairs) {
      std::vector<double> errors;
      for (const auto& [a, b] : whitened_.CommonObservations(pair.frame_a, pair.frame_b)) {
        const auto error_a = model.PixelError(a);
        const auto error_b = model.PixelError(b);
        errors.push_back(error_a && error_b ? std::hypot(error_a->norm(), error_b->norm())
                                            : kInfinity);
      }
      // A focal length that is off makes parallax of a rotation.
      double parallax_px = pair.parallax_px;
      for (const Camera& camera : CamerasToTry(model.camera())) {
        const FramePairMotion motion = MeasureMotion(whitened_, camera, pair.frame_a, pair.frame_b);
        parallax_px = std::min(parallax_px, motion.parallax_px);
      }
      ratios.push_back(Median(std::move(errors)) / parallax_px);
    }
    return ratios.empty() ? kInfinity : Median(std::move(ratios));
  }

  // Standard deviation of the coordinates of what the model believes [px], robust. Not much more
  // than the tracks' own noise (EstimateNoise), unless the camera is another or the tracks drift.
  double NoiseLeftPx(const WorkingModel& model) const {
    constexpr double kMedianOfRayleigh = 1.1774;
    std::vector<double> errors;
    for (int o = 0; o < static_cast<int>(whitened_.observations().size()); ++o) {
      if (!model.IsInlier(o)) continue;
      if (const auto error = model.PixelError(o)) errors.push_back(error->norm());
    }
    return Median(std::move(errors)) / kMedianOfRayleigh;
  }

  // What the tracks say of a camera that is kept: refined on the keyframes alone. None where they
  // have no better one to offer.
  std::optional<Camera> BetterCamera(const WorkingModel& model,
                                     const std::vector<int>& keyframes) const {
    WorkingModel trial(model);
    std::vector<int> frames;
    for (const int f : keyframes) {
      if (trial.HasPose(f)) frames.push_back(f);
    }
    constexpr std::size_t kMinFrames = 4;
    if (frames.size() < kMinFrames) return std::nullopt;
    BundleOptions bundle = Bundle(trial, 10, 1e-4);
    const double before = trial.Adjust(frames, {}, bundle).bundle.final_cost;
    bundle.refine_focal = bundle.refine_radial = true;
    const double after = trial.Adjust(frames, {}, bundle).bundle.final_cost;
    // Three more parameters cannot take a fifth of a cost of hundreds of residuals by chance.
    constexpr double kMuchBetter = 0.8;
    if (after < kMuchBetter * before) return trial.camera();
    return std::nullopt;
  }

 private:
  bool RefinesFocal() const { return !camera_.known && options_.refine_focal; }

  std::vector<StartModel> Starts(const FramePairMotion& pair) const {
    StartOptions options;
    options.model = model_options_;
    options.refine_focal = RefinesFocal();
    std::vector<StartModel> starts = BuildStartModels(whitened_, camera_, pair, options);
    for (const StartModel& s : starts) {
      spdlog::debug(
          "start in frames {} to {} by {}: cost {:.1f}, {} points, f {:.1f}, noise {:.3f}",
          pair.frame_a,
          pair.frame_b,
          NameOf(kStartMethodNames, s.method),
          s.cost,
          s.model.CountPoints(),
          s.model.camera().fx,
          s.model.noise());
    }
    return starts;
  }

  // Grows the best start; with it the best that is another scene, where the window could not tell
  // them apart. If the whole cannot either, the clip is ambiguous.
  Mapped GrowBest(std::vector<StartModel> starts, const std::vector<int>& keyframes) const {
    constexpr double kSameScene = 0.05;  // DepthDisagreement
    StartModel& best = starts.front();
    const auto rival = std::find_if(starts.begin() + 1, starts.end(), [&](const StartModel& s) {
      return WorkingModel::DepthDisagreement(best.model, s.model, best.window.front()) >
                 kSameScene &&
             !Distinguishes(best.cost, s.cost, best.model.noise());
    });
    Grow(best.model, keyframes);
    if (rival == starts.end()) return {MapperTermination::kSuccess, "", std::move(best.model)};

    Grow(rival->model, keyframes);
    const double bound = std::min(best.model.ErrorBound(), rival->model.ErrorBound());
    const double cost = best.model.TruncatedCost(keyframes, bound);
    const double rival_cost = rival->model.TruncatedCost(keyframes, bound);
    const double noise = std::min(best.model.noise(), rival->model.noise());
    spdlog::debug("two scenes fit the start; over all keyframes their costs are {:.1f} and {:.1f}",
                  cost,
                  rival_cost);
    if (!Distinguishes(std::min(cost, rival_cost), std::max(cost, rival_cost), noise)) {
      return {MapperTermination::kAmbiguous,
              "two different scenes explain the tracks equally well (a plane or too little "
              "perspective)"};
    }
    return {
        MapperTermination::kSuccess, "", std::move(cost <= rival_cost ? best.model : rival->model)};
  }

  // Whether a cost is larger than another by more than noise would make it: 2 log likelihood.
  static bool Distinguishes(double cost, double larger_cost, double noise) {
    constexpr double kEvidence = 20.0;
    const double variance = std::max(noise, kMinNoise) * std::max(noise, kMinNoise);
    return larger_cost - cost > kEvidence * variance;
  }

  // Registered frames by distance in time. Looks no further than it must: it is asked for every
  // frame.
  static std::vector<int> Nearest(const WorkingModel& model, int frame, std::size_t count) {
    const int frame_count = model.whitened().frame_count();
    std::vector<int> frames;
    for (int d = 0; d < frame_count; ++d) {
      for (const int f : {frame - d, frame + d}) {
        if (frames.size() == count) return frames;
        if (f < 0 || f >= frame_count || !model.HasPose(f)) continue;
        if (frames.empty() || frames.back() != f) frames.push_back(f);  // both are one if d is 0
      }
    }
    return frames;
  }

  static bool Register(WorkingModel& model, int frame) {
    const std::vector<int> nearest = Nearest(model, frame, 1);
    return model.RegisterFrame(
        frame, nearest.empty() ? std::nullopt : std::optional(model.Pose(nearest.front())));
  }

  void AdjustAround(WorkingModel& model, int frame) const {
    const std::vector<int> near = Nearest(model, frame, kLocalFree + kLocalFixed);
    const std::size_t free = std::min<std::size_t>(kLocalFree, near.size());
    BundleOptions bundle = Bundle(model, 6, 1e-3);
    // A new pose is not settled: what the settled part calls noise would leave its observations
    // without a say.
    bundle.loss_scale =
        std::max(bundle.loss_scale, 2.0 * options_.loss_scale * model.MedianError(frame));
    bundle.refine_focal = bundle.refine_radial = bundle.refine_principal_point = false;
    model.Adjust(std::span(near).first(free), std::span(near).subspan(free), bundle);
  }

  void AdjustAll(WorkingModel& model) const {
    model.UpdateAllInliers(kInfinity);
    model.Adjust(model.RegisteredFrames(), {}, Bundle(model, 10, 1e-3));
    model.UpdateAllInliers(kInfinity);
    model.TriangulateAllTracks();
  }

  std::vector<int> TracksOf(int frame) const {
    std::vector<int> tracks;
    for (const int o : whitened_.ObservationsIn(frame))
      tracks.push_back(whitened_.observations()[o].track);
    return tracks;
  }

  // Adds one keyframe after the other, always the one that sees most points; where none can be
  // added, plain frames next to the model.
  void Grow(WorkingModel& model, const std::vector<int>& keyframes) const {
    AdjustAll(model);
    double adjusted_at = model.registered();
    std::set<int> refused;
    int stuck_at = -1;  // frames registered
    for (;;) {
      const std::optional<int> frame = NextFrame(model, keyframes, refused);
      if (!frame) {
        // Stuck: once more with what there is adjusted, and content with less.
        if (MissesNone(model, keyframes) || model.registered() == stuck_at) break;
        stuck_at = model.registered();
        refused.clear();
        model.Relax(true);
        AdjustAll(model);
        continue;
      }
      if (!Register(model, *frame)) {
        refused.insert(*frame);
        continue;
      }
      refused.clear();
      const std::vector<int> tracks = TracksOf(*frame);
      model.UpdateInliers(tracks, kInfinity);
      model.TriangulateTracks(tracks);
      AdjustAround(model, *frame);
      model.UpdateInliers(tracks, kInfinity);
      if (model.registered() >= kGlobalGrowth * adjusted_at) {
        AdjustAll(model);
        adjusted_at = model.registered();
      }
    }
    model.Relax(false);
    AdjustAll(model);
    Polish(model, 4, 5);
  }

  static bool MissesNone(const WorkingModel& model, const std::vector<int>& keyframes) {
    return std::all_of(
        keyframes.begin(), keyframes.end(), [&](int frame) { return model.HasPose(frame); });
  }

  // None: there is none left to try.
  std::optional<int> NextFrame(const WorkingModel& model,
                               const std::vector<int>& keyframes,
                               const std::set<int>& refused) const {
    const auto best_of = [&](const std::vector<int>& candidates) {
      std::optional<int> best;
      int most = 0;
      for (const int f : candidates) {
        if (model.HasPose(f) || refused.contains(f)) continue;
        const int points = model.CountVisiblePoints(f);
        if (points > most) {
          most = points;
          best = f;
        }
      }
      return best;
    };
    if (const auto keyframe = best_of(keyframes)) return keyframe;
    // Beside the model, only where keyframes are still missing on that side.
    std::vector<int> beside;
    for (const int k : keyframes) {
      if (model.HasPose(k)) continue;
      const int nearest = Nearest(model, k, 1).front();
      const int step = k > nearest ? 1 : -1;
      if (nearest + step != k) beside.push_back(nearest + step);
    }
    return best_of(beside);
  }

  const WhitenedTracks& whitened_;
  Camera camera_;
  MapperOptions options_;
  WorkingModelOptions model_options_;
};

// Models of the clip's parts: one, unless the tracks break off somewhere. The one of most frames is
// first.
std::vector<WorkingModel> MapParts(const Mapper& mapper,
                                   std::vector<int> keyframes,
                                   std::optional<WorkingModel> model) {
  std::vector<WorkingModel> parts;
  while (model && parts.size() < kMaxComponents) {
    mapper.Fill(*model);
    std::vector<int> rest;
    for (const int k : keyframes) {
      if (!model->HasPose(k)) rest.push_back(k);
    }
    parts.push_back(std::move(*model));
    if (rest.size() < 2) break;
    keyframes = std::move(rest);
    model = mapper.Map(keyframes).model;
  }
  std::stable_sort(parts.begin(), parts.end(), [](const WorkingModel& a, const WorkingModel& b) {
    return a.registered() > b.registered();
  });
  return parts;
}

OtherComponent Describe(const WorkingModel& model) {
  const std::vector<int> frames = model.RegisteredFrames();
  return {model.whitened().frames()[frames.front()].index,
          model.whitened().frames()[frames.back()].index,
          frames.size(),
          model.CountPoints()};
}

void EstimateCovariances(WorkingModel& model, const Mapper& mapper, MapperResult& result) {
  const std::vector<int> frames = model.RegisteredFrames();
  BundleOptions bundle = mapper.Bundle(model, 10, 1e-8);
  bundle.covariances = true;
  const ModelAdjustment adjustment = model.Adjust(frames, {}, bundle);
  const std::optional<BundleCovariances>& covariances = adjustment.bundle.covariances;
  if (!covariances) {
    spdlog::warn("covariances could not be estimated: the problem is rank deficient");
    return;
  }
  const WhitenedTracks& whitened = model.whitened();
  const double variance = model.noise() * model.noise();
  for (std::size_t i = 0; i < frames.size(); ++i) {
    result.camera_covariances[whitened.frames()[frames[i]].index] =
        variance * covariances->cameras[i];
  }
  for (std::size_t i = 0; i < adjustment.tracks.size(); ++i) {
    result.point_covariances[whitened.features()[adjustment.tracks[i]]] =
        variance * covariances->points[i];
  }
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

WhiteningOptions WhiteningOptionsFrom(const MapperOptions& options) {
  WhiteningOptions result;
  result.min_track_length = options.min_track_length;
  result.use_covariances = options.use_covariances;
  result.covariance_floor_px = options.covariance_floor_px;
  result.include_predicted = options.include_predicted;
  result.predicted_growth_px = options.predicted_growth_px;
  return result;
}

// Bundle adjustment of the model's points from all that is believed of them; the poses stay.
void AdjustPoints(WorkingModel& model, const BundleOptions& options) {
  const WhitenedTracks& whitened = model.whitened();
  BundleProblem problem;
  problem.intrinsics = model.camera();
  std::vector<int> camera_of_frame(whitened.frame_count(), -1);
  for (const int frame : model.RegisteredFrames()) {
    camera_of_frame[frame] = static_cast<int>(problem.cameras.size());
    problem.cameras.push_back({model.Pose(frame), true});
  }
  std::vector<int> tracks;
  for (int track = 0; track < whitened.track_count(); ++track) {
    if (!model.HasPoint(track)) continue;
    const auto [first, last] = whitened.TrackRange(track);
    for (int o = first; o < last; ++o) {
      if (!model.IsInlier(o)) continue;
      const WhitenedObservation& observation = whitened.observations()[o];
      problem.observations.push_back({camera_of_frame[observation.frame],
                                      static_cast<int>(tracks.size()),
                                      observation.xy,
                                      observation.covariance_px2});
    }
    tracks.push_back(track);
    problem.points_in_world.push_back(model.Point(track));
  }
  if (problem.observations.empty()) return;
  const BundleResult result = AdjustBundle(std::move(problem), options);
  if (result.termination == BundleTermination::kFailed) return;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    model.SetPoint(tracks[i], result.solution.points_in_world[i]);
  }
}

}  // namespace

MapperResult ReconstructWithCeres(const TrackFile& file, const MapperOptions& options) {
  ValidateOptions(options);
  const auto started = std::chrono::steady_clock::now();
  MapperResult result;
  const auto end = [&](MapperTermination termination, const std::string& detail) {
    result.termination = termination;
    result.summary = Summarize(result.reconstruction, file.frames.size());
    result.summary.termination = std::string(NameOf(kMapperTerminationNames, termination));
    if (!detail.empty()) result.summary.termination += ": " + detail;
    result.summary.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
    for (const FeatureId feature : file.tracks.features()) {
      if (!result.reconstruction.points.contains(feature)) result.without_point.push_back(feature);
    }
    return result;
  };
  const Camera camera = CameraOrGuess(file);
  if (file.frames.size() < 2) {
    return end(MapperTermination::kTooFewTracks,
               fmt::format("the clip has {} frame, at least 2 are needed", file.frames.size()));
  }
  const WhitenedTracks whitened(file, WhiteningOptionsFrom(options));
  if (whitened.track_count() == 0) {
    return end(MapperTermination::kTooFewTracks,
               fmt::format("none of {} tracks is observed in {} frames",
                           file.tracks.features().size(),
                           options.min_track_length));
  }

  const Mapper mapper(whitened, camera, options);
  const std::vector<int> keyframes =
      SelectKeyframes(whitened, camera, options.keyframe_parallax_px, kMinKeyframes);
  Mapped first = mapper.Map(keyframes);
  if (!first.model) return end(first.termination, first.detail);
  std::vector<WorkingModel> parts = MapParts(mapper, keyframes, std::move(first.model));
  WorkingModel& model = parts.front();
  for (const WorkingModel& part : std::span(parts).subspan(1)) {
    result.other_components.push_back(Describe(part));
  }
  mapper.Polish(model, 3, 4);
  model.Normalise();
  result.noise = model.noise();

  const double uncertainty = model.MedianDepthUncertainty();
  const double unexplained = mapper.UnexplainedParallax(model, keyframes);
  spdlog::debug("depth uncertainty {:.3f}, unexplained parallax {:.3f}", uncertainty, unexplained);
  constexpr double kMaxDepthUncertainty = 0.3;
  if (uncertainty > kMaxDepthUncertainty) {
    return end(MapperTermination::kWeakDepth,
               fmt::format("depths are known to {:.0f} % only: too little parallax for the noise",
                           100.0 * uncertainty));
  }
  // Half of a drift is across the epipolar lines, where no depth explains it: of it alone a median
  // of 0.57 (= 0.6745 / 1.1774) of the whole is left at least, and more as a track has one depth in
  // all frames. Where the truth was known: up to 0.65 for models of worth, from 0.76 on for
  // drifting tracks of a camera that stood still or turned.
  constexpr double kMaxUnexplained = 0.6;
  if (unexplained > kMaxUnexplained) {
    const Mapped none = mapper.WithoutModel(
        keyframes,
        {MapperTermination::kNotRigid,
         "no rigid scene explains how the tracks move beyond a rotation of the camera: they drift, "
         "or most of them are on things that move"});
    return end(none.termination, none.detail);
  }
  std::string detail;
  const auto say = [&detail](const std::string& text) {
    detail += (detail.empty() ? "" : "; ") + text;
  };
  if (!result.other_components.empty()) {
    say(fmt::format("the clip breaks into {} parts, this is the largest", parts.size()));
  }
  if (camera.known) result.better_camera = mapper.BetterCamera(model, keyframes);
  if (result.better_camera) {
    const Camera& better = *result.better_camera;
    say(
        fmt::format("the tracks contradict the camera given: they ask for fx {:.1f} instead of "
                    "{:.1f} px and k1 {:.3f}, k2 {:.3f} instead of {:.3f}, {:.3f}",
                    better.fx,
                    camera.fx,
                    better.k1,
                    better.k2,
                    camera.k1,
                    camera.k2));
  }
  // Refined from a camera that is far off, the better one may not be found. Clips whose camera was
  // right leave up to 1.3 times the tracks' noise, those with a wrong one from 2.2 on.
  constexpr double kMuchNoise = 2.0;
  constexpr double kMinNoisePx = 0.02;
  const double noise_px = std::max(EstimateNoise(whitened), kMinNoisePx);
  const double left_px = mapper.NoiseLeftPx(model);
  if (!result.better_camera && left_px > kMuchNoise * noise_px) {
    say(
        fmt::format("the model leaves a noise of {:.2f} px where that of the tracks is {:.2f} px: "
                    "the camera is another than {}, or the tracks drift or are on things that move",
                    left_px,
                    noise_px,
                    camera.known ? "the one given" : "was found"));
  }
  if (options.covariances) EstimateCovariances(model, mapper, result);
  result.reconstruction = ToReconstruction(model);
  const bool partial =
      TooFewRegistered(static_cast<std::size_t>(model.registered()), file.frames.size());
  return end(partial ? MapperTermination::kPartial : MapperTermination::kSuccess, detail);
}

MapperResult TriangulateWithCeres(const TrackFile& file,
                                  const std::map<FrameIndex, Rigid3>& cam_from_world,
                                  const MapperOptions& options) {
  ValidateOptions(options);
  if (!file.camera || !file.camera->known) {
    ThrowError("triangulation with given poses needs a known camera: give --camera");
  }
  const auto started = std::chrono::steady_clock::now();
  const Camera camera = CameraOrGuess(file);
  const WhitenedTracks whitened(file, WhiteningOptionsFrom(options));
  const Mapper mapper(whitened, camera, options);
  WorkingModel model(
      whitened,
      camera,
      {.max_reprojection_px = options.max_reprojection_px, .min_angle_deg = options.min_angle_deg});
  for (int frame = 0; frame < whitened.frame_count(); ++frame) {
    const auto pose = cam_from_world.find(whitened.frames()[frame].index);
    if (pose != cam_from_world.end()) model.SetPose(frame, pose->second);
  }
  model.TriangulateAllTracks();
  model.UpdateAllInliers(kInfinity);
  constexpr int kRounds = 3;
  for (int round = 0; round < kRounds; ++round) {
    AdjustPoints(model, mapper.Bundle(model, 20, 1e-6));
    model.UpdateAllInliers(model.ErrorBound());
    model.TriangulateAllTracks();
  }

  MapperResult result;
  result.reconstruction = ToReconstruction(model);
  result.noise = model.noise();
  result.summary = Summarize(result.reconstruction, file.frames.size());
  result.summary.termination = "triangulated with given poses";
  result.summary.seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
  result.termination =
      result.summary.Failed() ? MapperTermination::kPartial : MapperTermination::kSuccess;
  for (const FeatureId feature : file.tracks.features()) {
    if (!result.reconstruction.points.contains(feature)) result.without_point.push_back(feature);
  }
  return result;
}

}  // namespace cohort
