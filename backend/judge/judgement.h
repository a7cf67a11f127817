#pragma once

#include <optional>
#include <vector>

#include "backend/adjust/working_model.h"
#include "backend/judge/clip_motion.h"
#include "backend/scene/keyframes.h"
#include "backend/scene/mapper_termination.h"

namespace cohort {

// The termination of a clip without parallax beyond its noise: the camera stands still or only
// turns. Returns nullopt if there is parallax.
std::optional<MapperEnd> DescribeClipWithoutParallax(const WidestPairs& widest,
                                                     const Camera& camera,
                                                     double noise_px);

// The termination of a clip that moves but gave no model: static or turning if its motion is not
// that of a camera that travels through a scene, else `otherwise`.
MapperEnd ExplainMissingModel(const WhitenedTracks& whitened,
                              const Camera& camera,
                              const std::vector<int>& keyframes,
                              MapperEnd otherwise);

// The judgement of a model.
struct Judgement {
  // Median over points of the depth's relative standard deviation.
  double depth_uncertainty = 0.0;
  double unexplained_parallax = 0.0;   // UnexplainedParallax
  std::optional<MapperEnd> worthless;  // set if the model does not represent the scene: why
  std::vector<Doubt> doubts;           // of a model that is returned (others: doubts.h)
};

// Judges a model by the share of the parallax that it explains and by the uncertainty of its
// depths. `camera` is the clip's initial camera.
Judgement JudgeModel(const WorkingModel& model,
                     const Camera& camera,
                     const std::vector<int>& keyframes);

// Covariances assume that the errors of observations are independent and that the models of lens
// and shutter are true. On clips with truth, the errors of the cameras were 1.1 to 3 times as large
// as their covariances imply (median 2), and 10 to 20 times on two drives and a fast hand-held
// clip; those of the focal length were 4 to 6 times as large (median 5).
inline constexpr double kCameraErrorOverNoise = 2.0;
inline constexpr double kFocalErrorOverNoise = 5.0;

// The share of the parallax that the model leaves unexplained: over the pairs of keyframes with the
// most parallax, the median distance of the observations from the model's points, relative to that
// from the best rotation. It is small for a rigid scene. If the motion only looks like parallax, as
// with tracks that drift independently, no depths and no path bring it far below 1.
double UnexplainedParallax(const WorkingModel& model, const std::vector<int>& keyframes);

}  // namespace cohort
