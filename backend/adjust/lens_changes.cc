#include "backend/adjust/lens_changes.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "backend/scene/spread_tracks.h"

namespace cohort {
namespace {

// The focal length of every frame of the clip, by linear interpolation of its logarithm.
FocalScales BetweenFrames(const std::vector<FrameInfo>& frames,
                          const std::vector<int>& measured,
                          const std::vector<BundleCamera>& cameras) {
  FocalScales scales;
  std::size_t next = 0;  // the first measured frame that is not before
  for (int frame = 0; frame < static_cast<int>(frames.size()); ++frame) {
    while (next < measured.size() && measured[next] < frame) ++next;
    const std::size_t after = std::min(next, measured.size() - 1);
    const std::size_t before = next == 0 || measured[after] == frame ? after : next - 1;
    double share = 0.0;
    if (measured[after] > measured[before]) {
      share = std::clamp(static_cast<double>(frame - measured[before]) /
                             static_cast<double>(measured[after] - measured[before]),
                         0.0,
                         1.0);
    }
    scales[frames[static_cast<std::size_t>(frame)].index] =
        std::exp(std::lerp(cameras[before].lens_change[0], cameras[after].lens_change[0], share));
  }
  return scales;
}

// The poses of the measured frames; each other frame keeps its pose in the model relative to the
// measured frame before it.
std::map<FrameIndex, Rigid3> PosesBetween(const WorkingModel& model,
                                          const std::vector<int>& measured,
                                          const std::vector<BundleCamera>& cameras) {
  std::map<FrameIndex, Rigid3> poses;
  std::size_t before = 0;
  for (const int frame : model.RegisteredFrames()) {
    while (before + 1 < measured.size() && measured[before + 1] <= frame) ++before;
    const auto index = model.whitened().frames()[static_cast<std::size_t>(frame)].index;
    poses[index] =
        model.Pose(frame) * model.Pose(measured[before]).Inverse() * cameras[before].cam_from_world;
  }
  return poses;
}

// The degrees of freedom of a bundle adjustment of poses and points.
double DegreesOfFreedom(const BundleProblem& problem) {
  return 2.0 * static_cast<double>(problem.observations.size()) -
         6.0 * static_cast<double>(problem.cameras.size()) -
         3.0 * static_cast<double>(problem.points_in_world.size());
}

}  // namespace

bool LensChanges::IsChanging() const {
  // For cameras that were searched, constant lenses gained up to 4 % on rendered and real clips;
  // for zooms by 5 % to 100 % and shifted pictures, the better of both models gained 8 to 70 %. For
  // known cameras it gained 29 to 89 %, but also up to 25 % where KLT's tracks drifted on two
  // planes.
  constexpr double kGain = 0.07;
  constexpr double kGainOfKnown = 0.27;
  return std::max(focal_gain, center_gain) > (camera_known ? kGainOfKnown : kGain);
}

bool LensChanges::MayBeZoom() const {
  // A model that a zoom bent may gain as much by shifts: a rendered zoom of x1.25 that was not
  // found as a zoom gained .12 by focal lengths and .13 by shifts; a clip shifted by a stabiliser
  // gained .06 and .70.
  constexpr double kShareOfGain = 0.5;
  return focal_gain > kShareOfGain * center_gain;
}

std::optional<LensChanges> MeasureLensChanges(const WorkingModel& model,
                                              const CameraRefinement& refinement) {
  constexpr std::size_t kMostFrames = 40;  // bounds the time
  constexpr std::size_t kLeastFrames = 5;
  constexpr double kHeld = 1e-6;
  std::vector<int> frames = model.RegisteredFrames();
  if (frames.size() < kLeastFrames) return std::nullopt;
  if (frames.size() > kMostFrames) frames = Spread(frames, kMostFrames);
  const std::vector<int> tracks = SpreadTracks(model.whitened(), model.camera(), frames);
  const WhitenedTracks some = model.whitened().Select(tracks);
  WorkingModel trial(some, model, tracks);
  BundleOptions bundle = MapperBundleOptions(trial, refinement, 100, 1e-5);
  const BundleResult constant = trial.Adjust(frames, {}, bundle).bundle;
  if (constant.termination == BundleTermination::kFailed || !(constant.final_cost > 0.0)) {
    return std::nullopt;
  }
  bundle.refine_lens_changes = true;
  // A few iterations show whether there is no gain; only a model with a gain is brought to its
  // minimum.
  constexpr double kCoarse = 1e-3;
  constexpr double kGainsNothing = 0.02;
  // By chance, `more` parameters remove a share of the cost equal to their share of the degrees of
  // freedom.
  const double freedom = DegreesOfFreedom(constant.solution);
  const auto gain = [&](const BundleResult& changing, double more) {
    if (!(freedom > more)) return 0.0;
    return 1.0 - changing.final_cost / constant.final_cost * freedom / (freedom - more);
  };
  const auto changes = static_cast<double>(frames.size() - 1);
  const auto adjust = [&](const BundleOptions& options, double more) {
    BundleOptions coarse = options;
    coarse.function_tolerance = kCoarse;
    BundleResult result = WorkingModel(trial).Adjust(frames, {}, coarse).bundle;
    if (result.termination == BundleTermination::kFailed || gain(result, more) < kGainsNothing) {
      return result;
    }
    return WorkingModel(trial).Adjust(frames, {}, options).bundle;
  };
  BundleOptions focal = bundle;
  focal.center_walk_sigma_px = kHeld;
  const BundleResult zoom = adjust(focal, changes);
  BundleOptions center = bundle;
  center.zoom_walk_sigma = kHeld;
  const BundleResult shift = adjust(center, 2.0 * changes);
  if (zoom.termination == BundleTermination::kFailed ||
      shift.termination == BundleTermination::kFailed) {
    return std::nullopt;
  }
  LensChanges result;
  result.camera_known = !refinement.Any();
  result.focal = BetweenFrames(model.whitened().frames(), frames, zoom.solution.cameras);
  result.camera = zoom.solution.intrinsics;
  result.cam_from_world = PosesBetween(model, frames, zoom.solution.cameras);
  result.focal_gain = gain(zoom, changes);
  result.center_gain = gain(shift, 2.0 * changes);
  Eigen::Vector2d least = Eigen::Vector2d::Zero();
  Eigen::Vector2d most = Eigen::Vector2d::Zero();
  for (const BundleCamera& camera : shift.solution.cameras) {
    least = least.cwiseMin(camera.lens_change.tail<2>());
    most = most.cwiseMax(camera.lens_change.tail<2>());
  }
  result.shift_px = (most - least).norm();
  spdlog::debug("lens changes: focal length x{:.4f} gains {:.3f}, centre by {:.1f} px gains {:.3f}",
                ZoomOf(result.focal),
                result.focal_gain,
                result.shift_px,
                result.center_gain);
  return result;
}

}  // namespace cohort
