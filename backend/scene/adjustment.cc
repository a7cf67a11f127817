#include "backend/scene/adjustment.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <span>

#include "backend/scene/condensed_adjustment.h"
#include "backend/scene/spread_tracks.h"

namespace cohort {
namespace {

// Bundle adjustment of all points with an inlier, every registered camera fixed; and whose points
// they are.
struct PointProblem {
  BundleProblem bundle;
  std::vector<int> tracks;
};
PointProblem MakePointProblem(const WorkingModel& model) {
  const WhitenedTracks& whitened = model.whitened();
  PointProblem problem;
  problem.bundle.intrinsics = model.camera();
  std::vector<int> camera_of_frame(whitened.frame_count(), -1);
  for (const int frame : model.RegisteredFrames()) {
    camera_of_frame[frame] = static_cast<int>(problem.bundle.cameras.size());
    problem.bundle.cameras.push_back({model.Pose(frame), true});
  }
  for (int track = 0; track < whitened.track_count(); ++track) {
    if (!model.HasPoint(track)) continue;
    const auto [first, last] = whitened.TrackRange(track);
    for (int o = first; o < last; ++o) {
      if (!model.IsInlier(o)) continue;
      const WhitenedObservation& observation = whitened.observations()[o];
      problem.bundle.observations.push_back({camera_of_frame[observation.frame],
                                             static_cast<int>(problem.tracks.size()),
                                             observation.xy,
                                             observation.covariance_px2});
    }
    problem.tracks.push_back(track);
    problem.bundle.points_in_world.push_back(model.Point(track));
  }
  return problem;
}

// So many of them, from the first to the last.
std::vector<int> Spread(const std::vector<int>& frames, std::size_t count) {
  std::vector<int> some;
  for (std::size_t i = 0; i < count; ++i) {
    some.push_back(frames[i * (frames.size() - 1) / (count - 1)]);
  }
  return some;
}

}  // namespace

BundleOptions MapperBundleOptions(const WorkingModel& model,
                                  const CameraRefinement& refinement,
                                  int max_iterations,
                                  double function_tolerance) {
  BundleOptions bundle;
  bundle.loss = RobustLoss::kCauchy;
  // Tracks that claim to be exact may be further off than any bound, in their own units.
  bundle.loss_scale =
      std::clamp(model.loss_turn(), kMinWhitenedNoise, BundleOptions::kMaxLossScale);
  bundle.max_iterations = max_iterations;
  bundle.function_tolerance = function_tolerance;
  bundle.refine_focal = refinement.focal;
  bundle.refine_radial = refinement.radial;
  bundle.refine_principal_point = refinement.principal_point;
  return bundle;
}

void AdjustAround(WorkingModel& model, int frame) {
  // How many frames move, and how many neighbours hold them. Chosen by eye
  // on the tuning clips.
  constexpr std::size_t kFree = 4;
  constexpr std::size_t kFixed = 6;
  const std::vector<int> near = model.NearestRegistered(frame, kFree + kFixed);
  const std::size_t free = std::min(kFree, near.size());
  BundleOptions bundle = MapperBundleOptions(model, {}, 6, 1e-3);
  // A new pose is not settled: what the settled part calls noise would leave its observations
  // without a say.
  bundle.loss_scale =
      std::clamp(2.0 * model.MedianError(frame), bundle.loss_scale, BundleOptions::kMaxLossScale);
  model.Adjust(std::span(near).first(free), std::span(near).subspan(free), bundle);
}

BundleResult AdjustRegistered(WorkingModel& model, const BundleOptions& options) {
  const FrameRuns runs = ChooseRuns(model);
  if (runs.Condense()) return AdjustCondensed(model, runs, options);
  return model.Adjust(model.RegisteredFrames(), {}, options).bundle;
}

void AdjustAll(WorkingModel& model, const CameraRefinement& refinement) {
  model.UpdateAllInliers(kInfinity);
  AdjustRegistered(model, MapperBundleOptions(model, refinement, 10, 1e-3));
  model.UpdateAllInliers(kInfinity);
  model.TriangulateAllTracks();
}

void AdjustUntilSettled(WorkingModel& model,
                        const CameraRefinement& refinement,
                        int max_rounds,
                        int first_iterations) {
  // Share of the observations that change sides. Chosen by eye on the tuning clips.
  constexpr double kSettled = 2e-3;
  const auto observations = static_cast<double>(model.whitened().observations().size());
  model.UpdateAllInliers(kInfinity);
  for (int round = 0; round < max_rounds; ++round) {
    // Later rounds start beside the optimum: half the iterations do.
    const int iterations = round == 0 ? first_iterations : std::max(2, first_iterations / 2);
    const BundleResult adjustment =
        AdjustRegistered(model, MapperBundleOptions(model, refinement, iterations, 1e-5));
    const int changes = model.UpdateAllInliers(model.ErrorBound());
    const int found = model.TriangulateAllTracks();
    spdlog::debug("{}; {} observations change sides, {} new points, noise {:.3f}",
                  adjustment.Brief(),
                  changes,
                  found,
                  model.noise());
    if (changes + found < kSettled * observations) break;
  }
}

void AdjustToOptimum(WorkingModel& model, const CameraRefinement& refinement) {
  const BundleResult adjustment =
      AdjustRegistered(model, MapperBundleOptions(model, refinement, 30, 1e-8));
  spdlog::debug("to the optimum: {}", adjustment.Brief());
}

void AdjustPoints(WorkingModel& model) {
  PointProblem problem = MakePointProblem(model);
  if (problem.bundle.observations.empty()) return;
  const BundleResult result =
      AdjustBundle(std::move(problem.bundle), MapperBundleOptions(model, {}, 20, 1e-6));
  if (result.termination == BundleTermination::kFailed) return;
  for (std::size_t i = 0; i < problem.tracks.size(); ++i) {
    model.SetPoint(problem.tracks[i], result.solution.points_in_world[i]);
  }
}

std::optional<Camera> FindBetterCamera(const WorkingModel& model,
                                       const std::vector<int>& keyframes) {
  constexpr std::size_t kMinFrames = 4;
  constexpr std::size_t kMaxFrames = 16;  // a bound on time
  // Three more parameters cannot take a fifth of a cost of hundreds of residuals by chance.
  constexpr double kMuchBetter = 0.8;
  std::vector<int> frames;
  for (const int f : keyframes) {
    if (model.HasPose(f)) frames.push_back(f);
  }
  if (frames.size() < kMinFrames) return std::nullopt;
  if (frames.size() > kMaxFrames) frames = Spread(frames, kMaxFrames);
  constexpr int kPerCell = 2;
  const WhitenedTracks& whitened = model.whitened();
  const std::vector<int> tracks = SpreadTracks(whitened, model.camera(), frames, kPerCell);
  const WhitenedTracks some = whitened.Select(tracks);
  WorkingModel trial(some, model, tracks);
  BundleOptions bundle = MapperBundleOptions(trial, {}, 10, 1e-4);
  const BundleResult before = trial.Adjust(frames, {}, bundle).bundle;
  bundle.refine_focal = bundle.refine_radial = true;
  const BundleResult after = trial.Adjust(frames, {}, bundle).bundle;
  if (before.termination == BundleTermination::kFailed ||
      after.termination == BundleTermination::kFailed) {
    return std::nullopt;  // and so their costs say nothing
  }
  if (after.final_cost < kMuchBetter * before.final_cost) return trial.camera();
  return std::nullopt;
}

std::optional<ModelCovariances> CovariancesAtOptimum(WorkingModel model,
                                                     const CameraRefinement& refinement) {
  const std::vector<int> frames = model.RegisteredFrames();
  BundleOptions bundle = MapperBundleOptions(model, refinement, 10, 1e-8);
  bundle.covariances = true;
  const ModelAdjustment adjustment = model.Adjust(frames, {}, bundle);
  const std::optional<BundleCovariances>& covariances = adjustment.bundle.covariances;
  if (!covariances) return std::nullopt;
  const WhitenedTracks& whitened = model.whitened();
  const double variance = model.noise() * model.noise();
  ModelCovariances result;
  if (refinement.focal) {
    result.focal = std::sqrt(variance * covariances->intrinsics(0, 0)) /
                   adjustment.bundle.solution.intrinsics.fx;
  }
  for (std::size_t i = 0; i < frames.size(); ++i) {
    result.cameras[whitened.frames()[frames[i]].index] = variance * covariances->cameras[i];
  }
  for (std::size_t i = 0; i < adjustment.tracks.size(); ++i) {
    result.points[whitened.features()[adjustment.tracks[i]]] = variance * covariances->points[i];
  }
  return result;
}

}  // namespace cohort
