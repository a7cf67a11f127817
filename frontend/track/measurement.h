#pragma once

#include <Eigen/Core>
#include <vector>

#include "frontend/image/pyramid.h"
#include "frontend/track/tracker_options.h"
#include "frontend/tracks/observation.h"

namespace cohort {

// What a feature looked like where it was last anchored: a patch of the full resolution and one of
// the half, each window_px wide. Every later frame is measured against the anchor, so that errors
// do not add up from frame to frame.
struct AnchorPatch {
  std::vector<float> full;
  std::vector<float> half;
  double signal_variance = 0.0;  // of `full`
};
AnchorPatch TakeAnchor(const Pyramid& pyramid, const Eigen::Vector2d& xy, int window_px);

struct Measurement {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  bool converged = false;
  double correlation = 0.0;        // normalised, of anchor and picture, -1..1
  double residual_variance = 0.0;  // of anchor - picture after removing the mean difference
  double residual = 0.0;           // mean |anchor - picture|
  Eigen::Matrix2d gradient_energy =
      Eigen::Matrix2d::Zero();  // sum over the window of grad grad' [1/px^2]
};

// One unconstrained alignment: the translation x that minimises sum_u (T(u) - I(x + u) - mean)^2 by
// Gauss-Newton, first on the half resolution, then on the full, starting at `guide`.
Measurement MeasurePatch(const Pyramid& current,
                         const AnchorPatch& anchor,
                         const Eigen::Vector2d& guide,
                         int window_px);

}  // namespace cohort
