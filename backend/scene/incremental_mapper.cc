#include "backend/scene/incremental_mapper.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <set>

#include "backend/scene/initialization.h"
#include "backend/scene/keyframes.h"
#include "backend/scene/scene_model.h"

namespace cohort {
namespace {

constexpr int kMinKeyframes = 10;
constexpr int kMinCommonTracks = 12;
constexpr int kMaxStarts = 6;          // windows tried
constexpr int kMaxComponents = 20;     // of a clip that breaks
constexpr int kLocalFree = 4;          // frames that a local bundle adjustment moves
constexpr int kLocalFixed = 6;         // and neighbours that hold them
constexpr double kGlobalGrowth = 1.3;  // frames gained between global bundle adjustments
constexpr double kInfinity = std::numeric_limits<double>::infinity();

Camera CameraOf(const TrackFile& file) {
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

class Mapper {
 public:
  Mapper(const Clip& clip, const Camera& camera, const MapperOptions& options)
      : clip_(clip), camera_(camera), options_(options) {
    scene_options_.max_reprojection_px = options.max_reprojection_px;
    scene_options_.min_angle_deg = options.min_angle_deg;
  }

  // The model of the frames in `allowed` that a start among them grows to.
  struct Outcome {
    MapperTermination termination = MapperTermination::kNoStart;
    std::string detail;
    std::optional<SceneModel> model;
    std::vector<int> keyframes;  // that grew it
  };

  Outcome Map(const std::vector<int>& keyframes) {
    Outcome outcome;
    outcome.keyframes = keyframes;
    const std::vector<FramePairMotion> pairs =
        RankPairs(clip_, camera_, keyframes, kMinCommonTracks);
    if (pairs.empty()) {
      outcome.termination = MapperTermination::kTooFewTracks;
      outcome.detail = fmt::format("no two frames share {} tracks", kMinCommonTracks);
      return outcome;
    }
    const double noise_px = EstimateNoise(clip_);
    switch (ClassifyMotion(clip_, camera_, pairs, noise_px)) {
      case ClipMotion::kStatic:
        outcome.termination = MapperTermination::kStaticCamera;
        outcome.detail =
            fmt::format("tracks move by no more than their noise ({:.2f} px)", noise_px);
        return outcome;
      case ClipMotion::kRotation:
        outcome.termination = MapperTermination::kPureRotation;
        outcome.detail = "a rotation about the camera's centre explains all motion";
        return outcome;
      case ClipMotion::kParallax:
        break;
    }
    StartOptions start_options;
    start_options.scene = scene_options_;
    start_options.refine_focal = RefinesFocal();
    int tried = 0;
    std::vector<FramePairMotion> used;
    for (const FramePairMotion& pair : pairs) {
      // A window much like one that failed would fail again.
      const bool similar = std::any_of(used.begin(), used.end(), [&](const auto& u) {
        const int overlap = std::min(u.frame_b, pair.frame_b) - std::max(u.frame_a, pair.frame_a);
        return overlap > 0.7 * (pair.frame_b - pair.frame_a) &&
               overlap > 0.7 * (u.frame_b - u.frame_a);
      });
      if (similar) continue;
      used.push_back(pair);
      if (++tried > kMaxStarts) break;
      std::vector<StartModel> starts = BuildStartModels(clip_, camera_, pair, start_options);
      for (const StartModel& s : starts) {
        spdlog::debug("start {}-{} by {}: cost {:.0f}, {} points, f {:.1f}, noise {:.2f}",
                      pair.frame_a,
                      pair.frame_b,
                      NameOf(kStartMethodNames, s.method),
                      s.cost,
                      s.model.CountPoints(),
                      s.model.camera().fx,
                      s.model.noise());
      }
      if (starts.empty()) continue;
      outcome.model = std::move(starts.front().model);
      outcome.termination = MapperTermination::kSuccess;
      Grow(*outcome.model, keyframes);
      return outcome;
    }
    outcome.detail = "no pair of frames gave a consistent model";
    return outcome;
  }

  // Poses for all frames between and beyond the keyframes, then everything adjusted together.
  void Finish(SceneModel& model) {
    Fill(model);
    model.TriangulateAll();
    model.ReclassifyAll(kInfinity);
    constexpr int kMaxRounds = 6;
    constexpr double kSettled = 2e-3;  // share of the observations that change sides
    for (int round = 0; round < kMaxRounds; ++round) {
      const BundleResult result =
          model.Adjust(model.RegisteredFrames(), {}, Bundle(model, 20, round == 0 ? 1e-4 : 1e-6));
      const int changes = model.ReclassifyAll(model.ErrorBound());
      const int found = model.TriangulateAll();
      spdlog::debug("round {}: {}, {} changes, {} new points, noise {:.3f}",
                    round,
                    result.Brief(),
                    changes,
                    found,
                    model.noise());
      if (round > 0 &&
          changes + found < kSettled * static_cast<double>(clip_.observations().size())) {
        break;
      }
    }
  }

  BundleOptions Bundle(const SceneModel& model, int max_iterations, double tolerance) const {
    BundleOptions bundle;
    bundle.loss = options_.loss;
    bundle.loss_scale = std::max(0.02, options_.loss_scale * model.noise());
    bundle.max_iterations = max_iterations;
    bundle.function_tolerance = tolerance;
    bundle.threads = options_.threads;
    bundle.refine_focal = RefinesFocal();
    bundle.refine_radial = !camera_.known && options_.refine_radial;
    bundle.refine_principal_point = !camera_.known && options_.refine_principal_point;
    return bundle;
  }

 private:
  bool RefinesFocal() const { return !camera_.known && options_.refine_focal; }

  // Registered frames by distance in time.
  std::vector<int> Nearest(const SceneModel& model, int frame, std::size_t count) const {
    std::vector<int> frames = model.RegisteredFrames();
    std::stable_sort(frames.begin(), frames.end(), [frame](int a, int b) {
      return std::abs(a - frame) < std::abs(b - frame);
    });
    frames.resize(std::min(frames.size(), count));
    return frames;
  }

  bool Register(SceneModel& model, int frame) const {
    const std::vector<int> nearest = Nearest(model, frame, 1);
    return model.RegisterFrame(
        frame, nearest.empty() ? std::nullopt : std::optional(model.Pose(nearest.front())));
  }

  void AdjustAround(SceneModel& model, int frame) const {
    const std::vector<int> near = Nearest(model, frame, kLocalFree + kLocalFixed);
    const std::size_t free = std::min<std::size_t>(kLocalFree, near.size());
    BundleOptions bundle = Bundle(model, 6, 1e-3);
    bundle.refine_focal = bundle.refine_radial = bundle.refine_principal_point = false;
    model.Adjust(std::span(near).first(free), std::span(near).subspan(free), bundle);
  }

  void AdjustAll(SceneModel& model) const {
    model.ReclassifyAll(kInfinity);
    model.Adjust(model.RegisteredFrames(), {}, Bundle(model, 10, 1e-3));
    model.ReclassifyAll(kInfinity);
    model.TriangulateAll();
  }

  std::vector<int> TracksOf(int frame) const {
    std::vector<int> tracks;
    for (const int o : clip_.InFrame(frame)) tracks.push_back(clip_.observations()[o].track);
    return tracks;
  }

  // Adds one keyframe after the other, always the one that sees most points; where none can be
  // added, the plain frames next to the model.
  void Grow(SceneModel& model, const std::vector<int>& keyframes) const {
    AdjustAll(model);
    double adjusted_at = model.registered();
    std::set<int> refused;
    for (;;) {
      const int frame = NextFrame(model, keyframes, refused);
      if (frame < 0) break;
      if (!Register(model, frame)) {
        refused.insert(frame);
        continue;
      }
      refused.clear();
      const std::vector<int> tracks = TracksOf(frame);
      model.Reclassify(tracks, kInfinity);
      model.TriangulateTracks(tracks);
      AdjustAround(model, frame);
      model.Reclassify(tracks, kInfinity);
      if (model.registered() >= kGlobalGrowth * adjusted_at) {
        AdjustAll(model);
        adjusted_at = model.registered();
      }
    }
    AdjustAll(model);
  }

  // -1: there is none left to try.
  int NextFrame(const SceneModel& model,
                const std::vector<int>& keyframes,
                const std::set<int>& refused) const {
    const auto best_of = [&](const std::vector<int>& candidates) {
      int best = -1;
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
    const int keyframe = best_of(keyframes);
    if (keyframe >= 0) return keyframe;
    // Beside the model, only where keyframes are still missing on that side.
    std::vector<int> beside;
    for (const int k : keyframes) {
      if (model.HasPose(k)) continue;
      const std::vector<int> nearest = Nearest(model, k, 1);
      if (nearest.empty()) continue;
      const int step = k > nearest.front() ? 1 : -1;
      if (nearest.front() + step != k) beside.push_back(nearest.front() + step);
    }
    return best_of(beside);
  }

  void Fill(SceneModel& model) const {
    const std::vector<int> registered = model.RegisteredFrames();
    if (registered.empty()) return;
    for (int f = registered.front() + 1; f < clip_.frame_count(); ++f) {
      if (!model.HasPose(f)) Register(model, f);
    }
    for (int f = registered.front() - 1; f >= 0; --f) Register(model, f);
  }

  const Clip& clip_;
  Camera camera_;
  MapperOptions options_;
  SceneOptions scene_options_;
};

// Relative standard deviation of a point's depth along its mean ray, from the angle its rays span:
// median over points. Above about 0.3 a structure is noise.
double MedianDepthUncertainty(const SceneModel& model) {
  const Clip& clip = model.clip();
  std::vector<double> values;
  for (int t = 0; t < clip.track_count(); ++t) {
    if (!model.HasPoint(t)) continue;
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    double distance = kInfinity;
    const auto [first, last] = clip.TrackRange(t);
    for (int o = first; o < last; ++o) {
      if (!model.Active(o)) continue;
      const Rigid3& pose = model.Pose(clip.observations()[o].frame);
      const Eigen::Vector3d ray = model.Point(t) - pose.Inverse().translation;
      const double d = ray.norm();
      distance = std::min(distance, d);
      const Eigen::Vector3d u = ray / d;
      information += (Eigen::Matrix3d::Identity() - u * u.transpose()) / (d * d);
    }
    const double sigma = model.noise() / model.MeanFocal();
    const double weakest =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information).eigenvalues()[0];
    values.push_back(weakest > 0.0 ? sigma / std::sqrt(weakest) / distance : kInfinity);
  }
  if (values.empty()) return kInfinity;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Reconstruction ToReconstruction(const SceneModel& model) {
  const Clip& clip = model.clip();
  Reconstruction result;
  result.camera = model.camera();
  for (const int f : model.RegisteredFrames()) {
    const FrameInfo& info = clip.frames()[f];
    result.cam_from_world[info.index] = model.Pose(f);
    result.frame_names[info.index] = info.name;
    result.timestamps_ns[info.index] = info.timestamp_ns;
  }
  for (int t = 0; t < clip.track_count(); ++t) {
    if (!model.HasPoint(t)) continue;
    ScenePoint& point = result.points[clip.features()[t]];
    point.in_world = model.Point(t);
    const auto [first, last] = clip.TrackRange(t);
    for (int o = first; o < last; ++o) {
      if (!model.Active(o)) continue;
      const ClipObservation& observation = clip.observations()[o];
      point.views.push_back({clip.frames()[observation.frame].index, observation.xy});
      const auto xy = model.camera().Project(model.Pose(observation.frame) * point.in_world);
      point.mean_reprojection_px += (*xy - observation.xy).norm();
    }
    point.mean_reprojection_px /= static_cast<double>(point.views.size());
  }
  return result;
}

}  // namespace

MapperResult ReconstructWithCeres(const TrackFile& file, const MapperOptions& options) {
  ValidateOptions(options);
  const auto started = std::chrono::steady_clock::now();
  MapperResult result;
  const Camera camera = CameraOf(file);
  ClipOptions clip_options;
  clip_options.min_track_length = options.min_track_length;
  clip_options.use_covariances = options.use_covariances;
  clip_options.covariance_floor_px = options.covariance_floor_px;
  clip_options.include_predicted = options.include_predicted;
  clip_options.predicted_growth_px = options.predicted_growth_px;
  const Clip clip(file, clip_options);

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
  if (file.frames.size() < 2) {
    return end(MapperTermination::kTooFewTracks,
               fmt::format("the clip has {} frame, at least 2 are needed", file.frames.size()));
  }
  if (clip.track_count() == 0) {
    return end(MapperTermination::kTooFewTracks,
               fmt::format("none of the {} tracks is observed in {} frames",
                           file.tracks.features().size(),
                           options.min_track_length));
  }

  const std::vector<int> all_keyframes =
      SelectKeyframes(clip, camera, options.keyframe_parallax_px, kMinKeyframes);
  Mapper mapper(clip, camera, options);
  Mapper::Outcome best = mapper.Map(all_keyframes);
  if (!best.model) return end(best.termination, best.detail);
  SceneModel& model = *best.model;
  mapper.Finish(model);
  model.Normalise();
  result.noise_px = model.noise();
  const double uncertainty = MedianDepthUncertainty(model);
  spdlog::debug("median relative depth uncertainty {:.3f}", uncertainty);
  constexpr double kMaxDepthUncertainty = 0.3;
  if (uncertainty > kMaxDepthUncertainty) {
    return end(MapperTermination::kWeakDepth,
               fmt::format("depths are known to {:.0f} % only: too little parallax for the noise",
                           100.0 * uncertainty));
  }
  result.reconstruction = ToReconstruction(model);
  const bool partial = model.registered() * 10 < static_cast<int>(file.frames.size()) * 8;
  return end(partial ? MapperTermination::kPartial : MapperTermination::kSuccess, "");
}

}  // namespace cohort
