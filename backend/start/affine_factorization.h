#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "frontend/geometry/rigid3.h"

namespace cohort {

// Track `track` seen in `frame` (both dense, from 0) at the normalised image point n.
struct AffineMeasurement {
  int frame = 0;
  int track = 0;
  Eigen::Vector2d n = Eigen::Vector2d::Zero();
};

// Cameras and points under weak perspective, n = (R x)_xy / z + b, written as perspective poses (R,
// (z b, z)). A track with too few measurements has no point.
struct AffineModel {
  std::vector<Rigid3> cam_from_world;
  std::vector<std::optional<Eigen::Vector3d>> points_in_world;
};

struct AffineFactorization {
  // The images of an affine camera do not distinguish a scene from its mirror image in depth
  // (Necker reversal). A perspective bundle adjustment of both models resolves the ambiguity.
  std::array<AffineModel, 2> mirror_models;
  double rms_error = 0.0;  // of the rank-3 fit, normalised units, robust (1.4826 x median)
};

// Tomasi and Kanade (IJCV 1992) with missing measurements and outliers: rank-3 SVD of the tracks
// that all frames see, alternating least squares with Cauchy weights over all measurements, then
// the linear metric upgrade |i| = |j|, i.j = 0. Returns nullopt if there are fewer than 3 frames or
// 8 complete tracks, or if the fit has no third dimension (a plane, no rotation).
std::optional<AffineFactorization> FactorizeAffine(int frames,
                                                   int tracks,
                                                   std::span<const AffineMeasurement> measurements);

}  // namespace cohort
