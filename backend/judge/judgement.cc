#include "backend/judge/judgement.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

// Bounds the noise of clips without noise, for which the right camera left up to 0.09 px on
// rendered pictures with aliased edges, and a wrong one 0.11 px and more.
constexpr double kMinNoisePx = 0.05;

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

std::string DescribeDepths(double uncertainty) {
  if (!std::isfinite(uncertainty)) return "depths are unknown";
  return fmt::format("depths are known to {:.0f} % only", 100.0 * uncertainty);
}

std::string DescribeUnexplained(double share) {
  if (!std::isfinite(share)) return "none of the parallax is explained";
  return fmt::format("{:.0f} % of the parallax is unexplained", 100.0 * share);
}

}  // namespace

std::optional<MapperEnd> DescribeClipWithoutParallax(const WidestPairs& widest,
                                                     const Camera& camera,
                                                     double noise_px) {
  switch (ClassifyMotion(widest, camera, noise_px)) {
    case ClipMotion::kStatic:
      return MapperEnd{
          MapperTermination::kStaticCamera,
          fmt::format("the picture moves by {:.1f} px at most, and the noise of the tracks is "
                      "{:.2f} px",
                      widest.motion_px,
                      noise_px)};
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
  const std::vector<FramePairMotion> pairs = RankPairs(whitened, camera, keyframes);
  if (auto end = DescribeClipWithoutParallax(
          WidestPairsOf(whitened, pairs), camera, EstimateNoise(whitened))) {
    return *end;
  }
  const char* why =
      "if the camera moved, the tracks do not show it: they drift, or lie on moving objects";
  switch (ClassifyDrift(whitened, camera, pairs)) {
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
        ExplainMissingModel(model.whitened(),
                            camera,
                            keyframes,
                            {MapperTermination::kWeakDepth,
                             DescribeDepths(uncertainty) + ": too little parallax for the noise"});
  } else if (!(unexplained <= kMostUnexplained)) {
    judgement.worthless =
        ExplainMissingModel(model.whitened(),
                            camera,
                            keyframes,
                            {MapperTermination::kNotRigid,
                             "no rigid scene explains the motion of the tracks beyond a rotation "
                             "of the camera: they drift, or most of them lie on moving objects"});
  }
  if (TurnsByAnotherCamera(widest, camera, noise_px)) {
    judgement.doubts.push_back(
        {DoubtCode::kOnlyTurns,
         fmt::format("a camera that only turns, with another lens than {}, explains all motion as "
                     "well, and then there is no depth: walk sideways while you film, {}",
                     camera.known ? "the given one" : "the estimated one",
                     camera.known ? "check --camera" : "give --camera if you know it")});
  }
  if (uncertainty > kWeakDepth) {
    judgement.doubts.push_back({DoubtCode::kWeakDepth,
                                DescribeDepths(uncertainty) + ": move the camera further sideways",
                                {{"depth_uncertainty", uncertainty}}});
  }
  if (unexplained > kMuchUnexplained) {
    judgement.doubts.push_back({DoubtCode::kUnexplainedParallax,
                                DescribeUnexplained(unexplained) +
                                    ": the tracks drift or lie on moving objects, or the camera "
                                    "hardly moved; film along a longer path, in more light",
                                {{"unexplained_parallax", unexplained}}});
  }
  return judgement;
}

std::optional<double> CameraUncertainty(
    const std::map<FrameIndex, Eigen::Matrix<double, 6, 6>>& covariances,
    const Reconstruction& reconstruction) {
  std::vector<double> deviations;
  for (const auto& [frame, covariance] : covariances) {
    deviations.push_back(std::sqrt(covariance.bottomRightCorner<3, 3>().trace() / 3.0));
  }
  const double distance = MedianDistance(reconstruction);
  if (deviations.empty() || distance <= 0.0) return std::nullopt;
  return Median(std::move(deviations)) / distance;
}

std::optional<Doubt> DescribeExpectedError(double expected_error) {
  constexpr double kMostError = 0.01;
  constexpr double kSpread = 2.0;
  if (!(kSpread * expected_error > kMostError)) return std::nullopt;
  return Doubt{DoubtCode::kCamerasUncertain,
               fmt::format("the cameras are expected to be off by {:.1f} % of the extent of their "
                           "path, perhaps by twice as much: film along a longer path, in steady "
                           "light, with more texture in the picture",
                           100.0 * expected_error),
               {{"expected_error", expected_error}}};
}

std::optional<Doubt> DescribeUncertainFocal(double focal_sigma) {
  constexpr double kUncertain = 0.05;
  if (!(focal_sigma > kUncertain)) return std::nullopt;
  return Doubt{DoubtCode::kFocalUncertain,
               fmt::format("the focal length is known to {:.0f} % only, and depths are as "
                           "uncertain: turn the camera while it moves, or give --camera",
                           100.0 * focal_sigma),
               {{"focal_sigma", focal_sigma}}};
}

Doubt DescribeRivalCamera(const Camera& camera, const Camera& rival) {
  return Doubt{DoubtCode::kTwoCameras,
               fmt::format("two cameras explain the tracks equally well, with focal lengths of "
                           "{:.0f} and {:.0f} px: turn the camera while it moves, or give --camera",
                           camera.fx,
                           rival.fx),
               {{"focal_px", camera.fx}, {"rival_focal_px", rival.fx}}};
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

std::optional<Doubt> DescribeLine(const Reconstruction& reconstruction) {
  // Eleven real clips had 0.26 to 0.91. Nineteen sets of points near a line, from six of their
  // scenes, had 0.05 to 0.12, with cameras off by 0.5 to 60 % of their path, half of them by 8.6 %
  // and more; as many random points of the same clips had 0.21 to 0.76, with half of the cameras
  // off by 1.1 % or less.
  constexpr double kLine = 0.15;
  const double spread = SpreadAcrossLine(reconstruction);
  if (!(spread < kLine)) return std::nullopt;
  return Doubt{DoubtCode::kPointsOnALine,
               "the points lie along a line, about which the cameras may rotate freely: also film "
               "textured surfaces beside it",
               {{"spread_across_line", spread}}};
}

std::optional<Doubt> DescribeFewPoints(const Reconstruction& reconstruction) {
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
  return Doubt{
      DoubtCode::kFewPoints,
      fmt::format("{} constrained by few points, {}by {} where the others have {:.0f}, and few "
                  "points may drift together: film textured surfaces there, or leave {} out by "
                  "--frames",
                  few.size() == 1 ? fmt::format("frame {} is", ToInt(few.front()))
                                  : fmt::format("{} frames, the first of them {} and the last {}, "
                                                "are",
                                                few.size(),
                                                ToInt(few.front()),
                                                ToInt(few.back())),
                  few.size() == 1 ? "" : "one of them ",
                  least,
                  median,
                  few.size() == 1 ? "it" : "these frames"),
      {{"frames", static_cast<double>(few.size())},
       {"points", static_cast<double>(least)},
       {"median_points", median}}};
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

double NoiseLeftPx(const WorkingModel& model) {
  std::vector<double> errors;
  for (int o = 0; o < static_cast<int>(model.whitened().observations().size()); ++o) {
    if (!model.IsInlier(o)) continue;
    if (const auto error = model.PixelError(o)) errors.push_back(error->norm());
  }
  return Median(std::move(errors)) / std::sqrt(kMedianChiSquare2);
}

std::optional<Doubt> DescribeExcessNoise(const WorkingModel& model) {
  // Clips with the right camera leave up to 1.3 times the tracks' noise, those with a wrong one 2.2
  // times and more.
  constexpr double kMuchNoise = 2.0;
  const double noise_px = EstimateNoise(model.whitened());
  const double left_px = NoiseLeftPx(model);
  if (noise_px == 0.0) return std::nullopt;  // the noise is unknown
  if (!(left_px > kMuchNoise * std::max(noise_px, kMinNoisePx))) return std::nullopt;
  return Doubt{
      DoubtCode::kExcessNoise,
      fmt::format(
          "the model leaves a noise of {:.2f} px where that of the tracks is {:.2f} px: the given "
          "camera is wrong, or the tracks drift or lie on moving objects; check --camera",
          left_px,
          noise_px),
      {{"noise_left_px", left_px}, {"noise_px", noise_px}}};
}

}  // namespace cohort
