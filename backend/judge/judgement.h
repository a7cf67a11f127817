#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "backend/adjust/working_model.h"
#include "backend/judge/clip_motion.h"
#include "backend/scene/keyframes.h"
#include "backend/scene/mapper_termination.h"
#include "backend/scene/reconstruction.h"

namespace cohort {

// How a clip without parallax beyond its noise ends if it gives no model: its camera stands still
// or only turns. None: it has parallax.
std::optional<MapperEnd> DescribeClipWithoutParallax(const WidestPairs& widest,
                                                     const Camera& camera,
                                                     double noise_px);

// How a clip that moves and yet gave no model ends: where its motion is not that of a camera on its
// way through a scene, so; otherwise as it is.
MapperEnd ExplainMissingModel(const WhitenedTracks& whitened,
                              const Camera& camera,
                              const std::vector<int>& keyframes,
                              MapperEnd otherwise);

// What is to be thought of a model.
struct Judgement {
  double depth_uncertainty = 0.0;      // median over points of a depth's deviation, relative
  double unexplained_parallax = 0.0;   // UnexplainedParallax
  std::optional<MapperEnd> worthless;  // it says nothing of the scene; why
  std::vector<Doubt> doubts;           // of one that is returned
};

// By how much of the parallax the model explains and how well it knows its depths. `camera` is what
// the clip came with.
Judgement JudgeModel(const WorkingModel& model,
                     const Camera& camera,
                     const std::vector<int>& keyframes);

// Median standard deviation of a coordinate of the cameras' centres (of covariances of omega, centre)
// as a share of MedianDistance; none without either. What the noise of the tracks does, and nothing
// else: cameras were off by 1 to 4 times as much on rendered clips, by 7 times in changing light.
std::optional<double> CameraUncertainty(
    const std::map<FrameIndex, Eigen::Matrix<double, 6, 6>>& covariances,
    const Reconstruction& reconstruction);

// Covariances take the errors of observations for independent, and the model of the lens and of the
// shutter for true. On clips with truth the cameras' errors were 1.1 to 3 times what they say (median
// 2), on two drives and a fast hand 10 to 20 times; the focal length's were 4 to 6 times (median 5).
inline constexpr double kCameraErrorOverNoise = 2.0;
inline constexpr double kFocalErrorOverNoise = 5.0;

// Where the cameras may be off by more than 1 % of the extent of their path. Half of the clips with truth
// are off by more than is expected, and one in twenty by 2.6 times as much
// (docs/results/unknown_camera.md).
std::optional<Doubt> DescribeExpectedError(double expected_error);

// Where the focal length, of this relative standard deviation, is as good as unknown: of a camera that
// moves without turning, depths may be longer or shorter by any factor.
std::optional<Doubt> DescribeUncertainFocal(double focal_sigma);

// That another camera explains the tracks as well (FoundCamera::rival).
Doubt DescribeRivalCamera(const Camera& camera, const Camera& rival);

// Median over frames of how far the views of points spread across the line that fits them best,
// relative to along it: RMS distances in the picture, 1 where they have no direction.
double SpreadAcrossLine(const Reconstruction& reconstruction);
// Where the points lie along a line, about which cameras may turn.
std::optional<Doubt> DescribeLine(const Reconstruction& reconstruction);

// Where some frames are held by few points, in number and beside the other frames. Covariances do not say
// it: a few features before a blank wall drift together, and the model follows them.
std::optional<Doubt> DescribeFewPoints(const Reconstruction& reconstruction);

// How much of the parallax the model leaves unexplained: over the pairs of keyframes with most of
// it, the median distance of the observations from the model's points, relative to that from the
// best rotation. Small for a rigid scene; for what only looks like parallax, such as tracks that
// drift each on its own, no depths and no path bring it far below 1.
double UnexplainedParallax(const WorkingModel& model, const std::vector<int>& keyframes);

// Standard deviation of the coordinates of the model's inliers [px], robust. Not much more than the
// tracks' own noise (EstimateNoise), unless the camera is another or the tracks drift.
double NoiseLeftPx(const WorkingModel& model);

// Where the model leaves much more noise than the tracks have by themselves.
std::optional<Doubt> DescribeExcessNoise(const WorkingModel& model);

}  // namespace cohort
