#include "backend/judge/judgement.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "backend/scene/phrasebook.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

// The pairs of the model's keyframes with the most parallax, in descending order.
std::vector<FramePairMotion> PairsWithMostParallax(const WorkingModel& model,
                                                   const std::vector<int>& keyframes) {
  constexpr std::size_t kPairs = 12;
  std::vector<int> frames;
  for (const int f : keyframes) {
    if (model.HasPose(f)) frames.push_back(f);
  }
  std::vector<FramePairMotion> pairs = RankPairs(model.whitened(), model.camera(), frames);
  std::stable_sort(pairs.begin(), pairs.end(), [](const auto& a, const auto& b) {
    return a.parallax_px > b.parallax_px;
  });
  pairs.resize(std::min(pairs.size(), kPairs));
  return pairs;
}

}  // namespace

std::optional<MapperEnd> DescribeClipWithoutParallax(const WidestPairs& widest,
                                                     const Camera& camera,
                                                     double noise_px) {
  switch (ClassifyMotion(widest, camera, noise_px)) {
    case ClipMotion::kStatic:
      return StillPictureEnd(widest.motion_px, noise_px);
    case ClipMotion::kRotation:
      return OnlyTurnsEnd();
    case ClipMotion::kParallax:
      break;
  }
  return std::nullopt;
}

MapperEnd ExplainMissingModel(const WhitenedTracks& whitened,
                              const Camera& camera,
                              const std::vector<int>& keyframes,
                              MapperEnd otherwise) {
  const std::vector<FramePairMotion> pairs = RankPairs(whitened, camera, keyframes);
  if (auto end = DescribeClipWithoutParallax(
          WidestPairsOf(whitened, pairs), camera, EstimateNoise(whitened))) {
    return *end;
  }
  switch (ClassifyDrift(whitened, camera, pairs)) {
    case ClipMotion::kStatic:
      return StillWithDriftEnd();
    case ClipMotion::kRotation:
      return OnlyTurnsWithDriftEnd();
    case ClipMotion::kParallax:
      break;
  }
  return otherwise;
}

Judgement JudgeModel(const WorkingModel& model,
                     const Camera& camera,
                     const std::vector<int>& keyframes) {
  // Depths that may be off by a third show little of a scene; depths that may be off by their whole
  // length show nothing. Tuned on the tuning clips.
  constexpr double kWeakDepth = 0.3;
  constexpr double kWorthlessDepth = 1.0;
  // Half of a drift lies across the epipolar lines, where no depth explains it. This half alone
  // leaves a median of 0.57 (= 0.6745 / 1.1774) of the drift, and more because a track has one
  // depth in all frames. Noise remains likewise, so the ratio grows with darkness. On real clips,
  // models as good as those of the clip in daylight had up to 0.71 (a hand that turns the camera
  // fast, degraded) and, without correction of the rolling shutter, 1.16; tracks that drift over a
  // real picture that only turns gave no model, or 0.81 to 2.7. In the ambiguous range a model is
  // returned with a doubt; a model that fits much worse than a rotation is useless.
  constexpr double kMuchUnexplained = 0.6;
  constexpr double kMostUnexplained = 1.5;
  const double uncertainty = model.MedianDepthUncertainty();
  const double unexplained = UnexplainedParallax(model, keyframes);
  Judgement judgement{uncertainty, unexplained, std::nullopt, {}};
  // For a guessed camera, a wrong focal length may be found that turns a rotation into parallax.
  const std::vector<FramePairMotion> pairs = RankPairs(model.whitened(), camera, keyframes);
  // A clip with a known camera is never rejected as a rotation here; the doubt about it uses all
  // tracks.
  const WidestPairs widest =
      camera.known ? WidestPairsOf(model.whitened(), pairs) : WidestPairsOf(model, pairs);
  const double noise_px = EstimateNoise(model.whitened());
  if (!camera.known) judgement.worthless = DescribeClipWithoutParallax(widest, camera, noise_px);
  if (judgement.worthless) return judgement;
  if (!(uncertainty <= kWorthlessDepth)) {
    judgement.worthless =
        ExplainMissingModel(model.whitened(), camera, keyframes, WeakDepthEnd(uncertainty));
  } else if (!(unexplained <= kMostUnexplained)) {
    judgement.worthless = ExplainMissingModel(model.whitened(), camera, keyframes, NotRigidEnd());
  }
  if (TurnsByAnotherCamera(widest, camera, noise_px)) {
    judgement.doubts.push_back(OnlyTurnsDoubt(camera.known));
  }
  if (uncertainty > kWeakDepth) judgement.doubts.push_back(WeakDepthDoubt(uncertainty));
  if (unexplained > kMuchUnexplained) {
    judgement.doubts.push_back(UnexplainedParallaxDoubt(unexplained));
  }
  return judgement;
}

double UnexplainedParallax(const WorkingModel& model, const std::vector<int>& keyframes) {
  const WhitenedTracks& whitened = model.whitened();
  std::vector<double> ratios;
  for (const FramePairMotion& pair : PairsWithMostParallax(model, keyframes)) {
    std::vector<double> errors;
    for (const auto& [a, b] : whitened.CommonObservations(pair.frame_a, pair.frame_b)) {
      const auto error_a = model.PixelError(a);
      const auto error_b = model.PixelError(b);
      errors.push_back(error_a && error_b ? std::hypot(error_a->norm(), error_b->norm())
                                          : kInfinity);
    }
    // A wrong focal length turns a rotation into parallax.
    double parallax_px = pair.parallax_px;
    for (const Camera& camera : CamerasToTry(model.camera())) {
      const FramePairMotion motion = MeasureMotion(whitened, camera, pair.frame_a, pair.frame_b);
      parallax_px = std::min(parallax_px, motion.parallax_px);
    }
    ratios.push_back(Median(std::move(errors)) / parallax_px);
  }
  return ratios.empty() ? kInfinity : Median(std::move(ratios));
}

}  // namespace cohort
