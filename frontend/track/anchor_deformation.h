#pragma once

#include <Eigen/Core>
#include <span>

#include "frontend/track/feature.h"

namespace cohort {

// The scale and rotation (a -b; b a) that carry `before` to `now` (2 x F each [px]) about their
// means, by least absolute distances over the features that the last frame confirmed; the identity
// where these are fewer than four.
Eigen::Matrix2d CommonSimilarity(const Eigen::Matrix2Xd& before,
                                 const Eigen::Matrix2Xd& now,
                                 std::span<const Feature> features);

// Carries every anchor's warp along with the cohort's similarity; what that misses (`warp_noise`, a
// share) is left to the measurement.
void DeformAnchors(const Eigen::Matrix2d& similarity,
                   double warp_noise,
                   std::span<Feature> features);

}  // namespace cohort
