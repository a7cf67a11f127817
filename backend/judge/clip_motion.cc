#include "backend/judge/clip_motion.h"

#include <spdlog/spdlog.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "backend/geometry/best_rotation.h"
#include "backend/start/two_view_geometry.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr std::size_t kMostPairs = 12;

template <typename Keep>
WidestPairs WidestPairsWhere(const WhitenedTracks& whitened,
                             std::vector<FramePairMotion> pairs,
                             double quantile,
                             const Keep& keep) {
  std::stable_sort(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) {
    return a.motion_px > b.motion_px;
  });
  pairs.resize(std::min(pairs.size(), kMostPairs));
  WidestPairs widest;
  widest.motion_px = pairs.empty() ? 0.0 : pairs.front().motion_px;
  widest.quantile = quantile;
  for (const FramePairMotion& pair : pairs) {
    Correspondences& points = widest.pairs.emplace_back();
    for (const auto& [a, b] : whitened.CommonObservations(pair.frame_a, pair.frame_b)) {
      if (!keep(a) || !keep(b)) continue;
      points.emplace_back(whitened.observations()[a].xy, whitened.observations()[b].xy);
    }
  }
  return widest;
}

// The largest parallax of these pairs: the median of the residuals of the best rotation or, if
// larger, their quantile, converted to the median that Rayleigh-distributed noise with that
// quantile would have.
double LargestParallaxPx(const WidestPairs& widest, const Camera& camera) {
  const double medians = std::sqrt(std::log(1.0 - widest.quantile) / std::log(0.5));
  double largest = 0.0;
  Correspondences rays;
  for (const Correspondences& pair : widest.pairs) {
    rays.clear();
    for (const auto& [xy_a, xy_b] : pair) {
      rays.emplace_back(camera.Unproject(xy_a), camera.Unproject(xy_b));
    }
    const BestRotation best = FitRotation(rays);
    largest =
        std::max({largest, Median(best.errors), Quantile(best.errors, widest.quantile) / medians});
  }
  return largest * 0.5 * (camera.fx + camera.fy);
}

// The minimum of LargestParallaxPx over focal length and k1, by a step-wise descent from this
// camera.
double LeastParallaxNear(const WidestPairs& widest, Camera camera) {
  constexpr double kFirstStep = 0.08;  // of log f, and of k1
  constexpr double kLastStep = 0.004;
  constexpr double kMostK1 = 0.3;
  double least_px = LargestParallaxPx(widest, camera);
  for (double step = kFirstStep; step > kLastStep;) {
    bool better = false;
    for (const auto& [log_f, k1] : {std::pair(step, 0.0),
                                    std::pair(-step, 0.0),
                                    std::pair(0.0, step),
                                    std::pair(0.0, -step)}) {
      Camera other = camera;
      other.fx *= std::exp(log_f);
      other.fy *= std::exp(log_f);
      other.k1 = std::clamp(other.k1 + k1, -kMostK1, kMostK1);
      const double px = LargestParallaxPx(widest, other);
      if (px >= least_px) continue;
      least_px = px;
      camera = other;
      better = true;
    }
    if (!better) step /= 2.0;
  }
  return least_px;
}

// Parallax below this threshold is not significant. Two views of a point with noise s leave a
// median of 1.67 s after the right rotation.
double LeastParallaxThatTells(double noise_px) {
  constexpr double kBeyondNoise = 3.0;
  constexpr double kMinNoise = 0.3;  // px
  return kBeyondNoise * std::max(kMinNoise, noise_px);
}

struct CameraAndParallax {
  Camera camera;
  double parallax_px;
};
// The camera of CamerasToTry that minimises the largest parallax of these pairs.
CameraAndParallax LeastOfThoseToTry(const WidestPairs& widest, const Camera& camera) {
  CameraAndParallax least{camera, std::numeric_limits<double>::infinity()};
  for (const Camera& candidate : CamerasToTry(camera)) {
    const double px = LargestParallaxPx(widest, candidate);
    if (px < least.parallax_px) least = {candidate, px};
  }
  return least;
}

using SecondDifferences = std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>>;  // at, of

// A frame's second differences without the affine motion that most of them share, because a shaking
// camera moves all of them alike, whether it turns or rolls.
std::vector<Eigen::Vector2d> WithoutCommonMotion(const SecondDifferences& differences) {
  constexpr int kRounds = 3;
  constexpr std::size_t kEnough = 12;  // for six parameters; with fewer, only the median is removed
  std::vector<double> x;
  std::vector<double> y;
  for (const auto& [at, d] : differences) {
    x.push_back(d.x());
    y.push_back(d.y());
  }
  Eigen::Matrix<double, 3, 2> common = Eigen::Matrix<double, 3, 2>::Zero();
  common.row(0) << Median(std::move(x)), Median(std::move(y));
  const auto rest = [&common](const auto& difference) -> Eigen::Vector2d {
    const Eigen::Vector3d basis(1.0, difference.first.x(), difference.first.y());
    return difference.second - common.transpose() * basis;
  };
  for (int round = 0; differences.size() >= kEnough && round < kRounds; ++round) {
    std::vector<double> lengths;
    for (const auto& difference : differences) lengths.push_back(rest(difference).norm());
    const double bound = std::max(3.0 * Median(lengths), 1e-9);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Matrix<double, 3, 2> right = Eigen::Matrix<double, 3, 2>::Zero();
    for (std::size_t i = 0; i < differences.size(); ++i) {
      if (lengths[i] > bound) continue;
      const Eigen::Vector3d basis(1.0, differences[i].first.x(), differences[i].first.y());
      normal += basis * basis.transpose();
      right += basis * differences[i].second.transpose();
    }
    common = normal.ldlt().solve(right);
  }
  std::vector<Eigen::Vector2d> left;
  for (const auto& difference : differences) left.push_back(rest(difference));
  return left;
}

}  // namespace

double EstimateNoise(const WhitenedTracks& whitened) {
  const auto& observations = whitened.observations();
  std::vector<SecondDifferences> in_frames(whitened.frame_count());
  for (std::size_t i = 2; i < observations.size(); ++i) {
    const WhitenedObservation& a = observations[i - 2];
    const WhitenedObservation& b = observations[i - 1];
    const WhitenedObservation& c = observations[i];
    if (a.track != c.track || c.frame != a.frame + 2) continue;
    // A repeated picture contains no information about the noise.
    constexpr double kSamePx = 0.002;
    if ((a.xy - b.xy).norm() < kSamePx || (b.xy - c.xy).norm() < kSamePx) continue;
    in_frames[b.frame].emplace_back(b.xy, a.xy - 2.0 * b.xy + c.xy);
  }
  std::vector<double> deviations;
  for (const SecondDifferences& differences : in_frames) {
    if (differences.empty()) continue;
    for (const Eigen::Vector2d& d : WithoutCommonMotion(differences)) {
      deviations.push_back(std::abs(d.x()));
      deviations.push_back(std::abs(d.y()));
    }
  }
  // A second difference has 1 + 4 + 1 times the variance of one observation.
  return 1.4826 * Median(std::move(deviations)) / std::sqrt(6.0);
}

std::vector<Camera> CamerasToTry(const Camera& camera) {
  if (camera.known) return {camera};
  std::vector<Camera> cameras;
  for (const double factor : {1.0, 0.84, 1.19, 0.7, 1.41, 0.6, 1.68, 0.5, 2.0}) {
    Camera& candidate = cameras.emplace_back(camera);
    candidate.fx *= factor;
    candidate.fy *= factor;
  }
  return cameras;
}

WidestPairs WidestPairsOf(const WhitenedTracks& whitened, std::vector<FramePairMotion> pairs) {
  return WidestPairsWhere(whitened, std::move(pairs), 0.5, [](int) { return true; });
}

WidestPairs WidestPairsOf(const WorkingModel& model, std::vector<FramePairMotion> pairs) {
  return WidestPairsWhere(
      model.whitened(), std::move(pairs), 0.9, [&](int o) { return model.IsInlier(o); });
}

ClipMotion ClassifyMotion(const WidestPairs& widest, const Camera& camera, double noise_px) {
  const double threshold = LeastParallaxThatTells(noise_px);
  if (widest.motion_px < threshold) return ClipMotion::kStatic;
  const auto [best, least_px] = LeastOfThoseToTry(widest, camera);
  if (least_px >= threshold) return ClipMotion::kParallax;
  // Of the picture's diagonal. A drone that stood on its legs with its motors on shook by .0023;
  // nobody calls a turn by a third of a degree a turn.
  constexpr double kShakes = 0.005;
  const double diagonal_px = std::hypot(camera.width_px, camera.height_px);
  return widest.motion_px < kShakes * diagonal_px ? ClipMotion::kStatic : ClipMotion::kRotation;
}

bool TurnsByAnotherCamera(const WidestPairs& widest, const Camera& camera, double noise_px) {
  // In units of the threshold: a focal length between those of CamerasToTry, or the distortion of a
  // lens, does not turn a rotation into more parallax than this.
  constexpr double kBeyondOtherCameras = 10.0;
  const double threshold = LeastParallaxThatTells(noise_px);
  const auto [best, px] = LeastOfThoseToTry(widest, camera);
  if (px < threshold || px >= kBeyondOtherCameras * threshold) return false;
  const double least_px = LeastParallaxNear(widest, best);
  spdlog::debug(
      "parallax beyond a rotation {:.2f} px, with another camera {:.2f} px, threshold {:.2f} px",
      px,
      least_px,
      threshold);
  return least_px < threshold;
}

ClipMotion ClassifyDrift(const WhitenedTracks& whitened,
                         const Camera& camera,
                         const std::vector<FramePairMotion>& pairs) {
  constexpr double kAlongEpipolarLines = 5.0;
  constexpr double kStill = 1.5;  // motion before the best rotation divided by that after it
  constexpr double kMinErrorPx = 0.05;
  for (const Camera& candidate : CamerasToTry(camera)) {
    std::vector<double> along;
    std::vector<double> turned;
    for (const FramePairMotion& pair : std::span(pairs).first(std::min(pairs.size(), kMostPairs))) {
      // So that the motion to be measured does not count as outliers.
      const double max_error_px = std::clamp(pair.parallax_px, TwoViewOptions{}.max_error_px, 50.0);
      const TwoViewGeometry geometry =
          EstimateTwoViewGeometry(whitened, pair.frame_a, pair.frame_b, candidate, max_error_px);
      if (geometry.kind == TwoViewKind::kDegenerate) continue;
      along.push_back(geometry.parallax_px / std::max(geometry.error_px, kMinErrorPx));
      turned.push_back(geometry.motion_px / std::max(geometry.parallax_px, kMinErrorPx));
    }
    if (along.empty() || Median(std::move(along)) > kAlongEpipolarLines) continue;
    return Median(std::move(turned)) < kStill ? ClipMotion::kStatic : ClipMotion::kRotation;
  }
  return ClipMotion::kParallax;
}

}  // namespace cohort
