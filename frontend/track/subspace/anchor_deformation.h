#pragma once

#include <Eigen/Core>
#include <span>

#include "frontend/track/measure/feature.h"

namespace cohort {

// The scale and rotation (a -b; b a) that carry `before` to `now` (2 x F each [px]) about their
// means. Minimises absolute distances over the features that the last frame confirmed. Returns the
// identity if there are fewer than four of them.
Eigen::Matrix2d CommonSimilarity(const Eigen::Matrix2Xd& before,
                                 const Eigen::Matrix2Xd& now,
                                 std::span<const MeasuredFeature> features);

// Updates every anchor's warp by the common similarity. `warp_noise` (a share) is added in
// quadrature to the warp's deviation, and the measurement corrects what the similarity misses.
void DeformAnchors(const Eigen::Matrix2d& similarity,
                   double warp_noise,
                   std::span<MeasuredFeature> features);

}  // namespace cohort
