#include "backend/scene/judgement.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "backend/scene/clip_motion.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The pairs of the model's keyframes with most parallax, most first.
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

std::optional<MapperEnd> RefuseClipWithoutParallax(const WhitenedTracks& whitened,
                                                   const Camera& camera,
                                                   const std::vector<FramePairMotion>& pairs) {
  const double noise_px = EstimateNoise(whitened);
  switch (ClassifyMotion(whitened, camera, pairs, noise_px)) {
    case ClipMotion::kStatic:
      return MapperEnd{
          MapperTermination::kStaticCamera,
          fmt::format("the tracks move by no more than their noise ({:.2f} px)", noise_px)};
    case ClipMotion::kRotation:
      return MapperEnd{
          MapperTermination::kPureRotation,
          "a rotation about the camera's centre explains all motion, so there is no depth"};
    case ClipMotion::kParallax:
      break;
  }
  return std::nullopt;
}

MapperEnd ExplainMissingModel(const WhitenedTracks& whitened,
                              const Camera& camera,
                              const std::vector<int>& keyframes,
                              MapperEnd otherwise) {
  const char* why =
      "if the camera moved, the tracks do not show it: they drift, or are on things that move";
  switch (ClassifyDrift(whitened, camera, RankPairs(whitened, camera, keyframes))) {
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

std::optional<MapperEnd> RefuseModel(const WorkingModel& model,
                                     const Camera& camera,
                                     const std::vector<int>& keyframes) {
  // Chosen by eye on the tuning clips: depths that can be a third off show no scene.
  constexpr double kMaxDepthUncertainty = 0.3;
  // Half of a drift is across the epipolar lines, where no depth explains it: of it alone a median
  // of 0.57 (= 0.6745 / 1.1774) of the whole is left at least, and more as a track has one depth in
  // all frames. Where the truth was known: up to 0.65 for models of worth, from 0.76 on for
  // drifting tracks of a camera that stood still or turned.
  constexpr double kMaxUnexplained = 0.6;
  const double uncertainty = model.MedianDepthUncertainty();
  const double unexplained = UnexplainedParallax(model, keyframes);
  spdlog::debug("depth uncertainty {:.3f}, unexplained parallax {:.3f}", uncertainty, unexplained);
  if (uncertainty > kMaxDepthUncertainty) {
    return MapperEnd{
        MapperTermination::kWeakDepth,
        fmt::format("depths are known to {:.0f} % only: too little parallax for the noise",
                    100.0 * uncertainty)};
  }
  if (unexplained > kMaxUnexplained) {
    return ExplainMissingModel(
        model.whitened(),
        camera,
        keyframes,
        {MapperTermination::kNotRigid,
         "no rigid scene explains how the tracks move beyond a rotation of the camera: they drift, "
         "or most of them are on things that move"});
  }
  return std::nullopt;
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
    // A focal length that is off makes parallax of a rotation.
    double parallax_px = pair.parallax_px;
    for (const Camera& camera : CamerasToTry(model.camera())) {
      const FramePairMotion motion = MeasureMotion(whitened, camera, pair.frame_a, pair.frame_b);
      parallax_px = std::min(parallax_px, motion.parallax_px);
    }
    ratios.push_back(Median(std::move(errors)) / parallax_px);
  }
  return ratios.empty() ? kInfinity : Median(std::move(ratios));
}

double NoiseLeftPx(const WorkingModel& model) {
  constexpr double kMedianOfRayleigh = 1.1774;
  std::vector<double> errors;
  for (int o = 0; o < static_cast<int>(model.whitened().observations().size()); ++o) {
    if (!model.IsInlier(o)) continue;
    if (const auto error = model.PixelError(o)) errors.push_back(error->norm());
  }
  return Median(std::move(errors)) / kMedianOfRayleigh;
}

std::string DescribeExcessNoise(const WorkingModel& model, bool camera_known) {
  // Clips whose camera was right leave up to 1.3 times the tracks' noise, those with a wrong one
  // from 2.2 on.
  constexpr double kMuchNoise = 2.0;
  constexpr double kMinNoisePx = 0.02;
  const double noise_px = std::max(EstimateNoise(model.whitened()), kMinNoisePx);
  const double left_px = NoiseLeftPx(model);
  if (!(left_px > kMuchNoise * noise_px)) return "";
  return fmt::format(
      "the model leaves a noise of {:.2f} px where that of the tracks is {:.2f} px: the camera is "
      "another than {}, or the tracks drift or are on things that move",
      left_px,
      noise_px,
      camera_known ? "the one given" : "was found");
}

}  // namespace cohort
