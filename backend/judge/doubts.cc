#include "backend/judge/doubts.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "backend/judge/aside.h"
#include "backend/judge/moving_share.h"
#include "backend/scene/phrasebook.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

// Bounds the noise of clips without noise, for which the right camera left up to 0.09 px on
// rendered pictures with aliased edges, and a wrong one 0.11 px and more.
constexpr double kMinNoisePx = 0.05;

// If the camera moves without turning, all depths may be scaled by any factor.
std::optional<Doubt> DoubtFocal(double focal_sigma) {
  constexpr double kUncertain = 0.05;
  if (!(focal_sigma > kUncertain)) return std::nullopt;
  return FocalUncertainDoubt(focal_sigma);
}

// One lens for all frames, although the tracks imply a lens that changes.
std::optional<Doubt> DoubtLens(const LensChanges& changes) {
  if (!changes.IsChanging()) return std::nullopt;
  if (changes.IsZoom()) return UnmodelledZoomDoubt(ZoomOf(changes.focal), changes.focal_gain);
  return CenterMovesDoubt(changes.shift_px, changes.center_gain, changes.MayBeZoom());
}

// Points along a line, about which the cameras may rotate.
std::optional<Doubt> DoubtLine(const Reconstruction& reconstruction) {
  // Eleven real clips had 0.26 to 0.91. Nineteen sets of points near a line, from six of their
  // scenes, had 0.05 to 0.12, with cameras off by 0.5 to 60 % of their path, half of them by 8.6 %
  // and more; as many random points of the same clips had 0.21 to 0.76, with half of the cameras
  // off by 1.1 % or less.
  constexpr double kLine = 0.15;
  const double spread = SpreadAcrossLine(reconstruction);
  if (!(spread < kLine)) return std::nullopt;
  return PointsOnALineDoubt(spread);
}

// The model may show something that moves, and not the scene.
std::optional<Doubt> DoubtMovingThings(const TrackFile& file, const Reconstruction& model) {
  // Right models of rendered clips of which people cover 30 % had 0 and 0.14; models of people who
  // cover half, instead of the scene, had 0.27 and 0.30.
  constexpr double kMost = 0.2;
  const std::optional<double> share = MovingShare(file, model);
  if (!share || *share <= kMost) return std::nullopt;
  return ThingsMoveDoubt(*share);
}

// One of several parts of its scene; other scenes do not count.
std::optional<Doubt> DoubtParts(const JudgedModel& judged) {
  if (judged.parts.size() < 2) return std::nullopt;
  const std::vector<Aside> asides = FindAsides(judged.file, judged.reconstruction);
  const auto is_aside = [&](int frame) {
    return AnyHas(asides, judged.file.frames[static_cast<std::size_t>(frame)].index);
  };
  const auto parts = std::ranges::count_if(judged.parts, [&](const WorkingModel& part) {
    return !std::ranges::all_of(part.RegisteredFrames(), is_aside);
  });
  if (parts < 2) return std::nullopt;
  return PartsDoubt(static_cast<std::size_t>(parts), judged.chosen == 0);
}

}  // namespace

std::optional<Doubt> DoubtExpectedError(double expected_error) {
  constexpr double kMostError = 0.01;
  constexpr double kSpread = 2.0;
  if (!(kSpread * expected_error > kMostError)) return std::nullopt;
  return CamerasUncertainDoubt(expected_error);
}

double SpreadAcrossLine(const Reconstruction& reconstruction) {
  std::map<FrameIndex, std::vector<Eigen::Vector2d>> seen;
  for (const auto& [feature, point] : reconstruction.points) {
    for (const PointView& view : point.views) seen[view.frame].push_back(view.xy);
  }
  std::vector<double> ratios;
  for (const auto& [frame, views] : seen) {
    if (views.size() < 3) continue;
    Eigen::Vector2d mean = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& xy : views) mean += xy / static_cast<double>(views.size());
    Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
    for (const Eigen::Vector2d& xy : views) scatter += (xy - mean) * (xy - mean).transpose();
    const Eigen::Vector2d variances =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(scatter, Eigen::EigenvaluesOnly)
            .eigenvalues();
    if (variances.y() > 0.0) {
      ratios.push_back(std::sqrt(std::max(variances.x(), 0.0) / variances.y()));
    }
  }
  return ratios.empty() ? 1.0 : Median(std::move(ratios));
}

std::optional<Doubt> DoubtFewPoints(const Reconstruction& reconstruction) {
  // Two clips of a white wall in the dark had 9 and 42 points in their poorest frames, 0.11 and
  // 0.25 of their medians, and cameras that were off by 25 and 22 %. None of 70 other clips,
  // rendered and real, bright and dark, had fewer than 160 points in a frame; one of them had 0.2
  // of its median.
  constexpr std::size_t kFew = 60;
  constexpr double kFewOfOthers = 0.4;
  std::map<FrameIndex, std::size_t> held;
  for (const auto& [frame, pose] : reconstruction.cam_from_world) held[frame] = 0;
  for (const auto& [feature, point] : reconstruction.points) {
    for (const PointView& view : point.views) ++held[view.frame];
  }
  std::vector<double> counts;
  for (const auto& [frame, count] : held) counts.push_back(static_cast<double>(count));
  const double median = Median(std::move(counts));
  // If few features were requested, all frames have few points.
  if (!(median > static_cast<double>(kFew))) return std::nullopt;
  std::vector<FrameIndex> few;
  std::size_t least = kFew;
  for (const auto& [frame, count] : held) {
    if (count >= kFew || !(static_cast<double>(count) < kFewOfOthers * median)) continue;
    few.push_back(frame);
    least = std::min(least, count);
  }
  if (few.empty()) return std::nullopt;
  return FewPointsDoubt(few, least, median);
}

double NoiseLeftPx(const WorkingModel& model) {
  std::vector<double> errors;
  for (int o = 0; o < static_cast<int>(model.whitened().observations().size()); ++o) {
    if (!model.IsInlier(o)) continue;
    if (const auto error = model.PixelError(o)) errors.push_back(error->norm());
  }
  return Median(std::move(errors)) / std::sqrt(kMedianChiSquare2);
}

std::optional<Doubt> DoubtNoise(const WorkingModel& model) {
  // Clips with the right camera leave up to 1.3 times the tracks' noise, those with a wrong one 2.2
  // times and more.
  constexpr double kMuchNoise = 2.0;
  const double noise_px = EstimateNoise(model.whitened());
  const double left_px = NoiseLeftPx(model);
  if (noise_px == 0.0) return std::nullopt;  // the noise is unknown
  if (!(left_px > kMuchNoise * std::max(noise_px, kMinNoisePx))) return std::nullopt;
  return ExcessNoiseDoubt(left_px, noise_px);
}

std::vector<Doubt> DoubtsOf(const JudgedModel& judged) {
  std::vector<Doubt> doubts = judged.judgement.doubts;
  const auto add = [&doubts](std::optional<Doubt> doubt) {
    if (doubt) doubts.push_back(std::move(*doubt));
  };
  if (judged.judgement.worthless) add(WorthlessDoubt(*judged.judgement.worthless));
  if (judged.better_camera) {
    add(CameraContradictedDoubt(*judged.better_camera, judged.camera));
  } else if (judged.camera.known) {
    // For a camera that was searched, there is no better one.
    add(DoubtNoise(judged.parts[judged.chosen]));
  }
  if (judged.lens_changes) add(DoubtLens(*judged.lens_changes));
  if (judged.focal_sigma) add(DoubtFocal(*judged.focal_sigma));
  if (judged.expected_error) add(DoubtExpectedError(*judged.expected_error));
  add(DoubtLine(judged.reconstruction));
  add(DoubtFewPoints(judged.reconstruction));
  add(DoubtMovingThings(judged.file, judged.reconstruction));
  add(DoubtParts(judged));
  if (judged.rival) add(TwoCamerasDoubt(judged.camera, *judged.rival));
  return doubts;
}

}  // namespace cohort
