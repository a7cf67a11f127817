#pragma once

#include <Eigen/Core>

#include "frontend/image/pyramid.h"
#include "frontend/track/measure/measurement.h"

namespace cohort {

// All that the subspace tracker stores of one feature, except its positions (Guide) and its
// trajectory's model (TrajectoryModel).
struct MeasuredFeature {
  AnchorPatch anchor;
  int window_px = 0;           // side of the measured patch; narrower once it is measured well
  double light = 0.0;          // change of its brightness since its birth; running mean
  double change = 1.0;         // of its innermost pixels, relative to the noise; running mean
  bool confirmed = true;       // the image confirmed it in the last frame
  int unexplained_frames = 0;  // in a row: neither confirmed nor hidden
};

// A feature born at `xy`. `smooth` is the picture denoised for measuring.
MeasuredFeature TakeFeature(const Pyramid& smooth,
                            const Eigen::Vector2d& xy,
                            const PatchOptions& patch);

}  // namespace cohort
