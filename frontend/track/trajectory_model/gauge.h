#pragma once

#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

// The gauge: no measurement determines the frame of the coordinates z. Both functions change
// cameras and coordinates together, so that every projection stays the same.

// [1 z] -> [1 + d'z, z], that is z -> z / (1 + d'z), and C = [m B] -> [m, B - m d'] (3 rows): a
// projective map, which moves the plane at infinity. With d the mean c of the frames, depths 1 +
// c'z have the mean 1, and the plane stays away from the features. Called every frame, for a small
// step.
void CenterDepths(State& state);

// z -> L^-1 (z - mean), C -> [m + B mean, B L], with LL' the features' scatter (with their
// covariances): an affine map that makes the prior z ~ N(0, I) their own distribution. Every C is
// then divided by its scale.
void NormalizeCoordinates(State& state);

}  // namespace cohort::trajectory_model
