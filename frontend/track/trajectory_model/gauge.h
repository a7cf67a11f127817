#pragma once

#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

// What no measurement tells: the frame of the coordinates z. Both change cameras and coordinates
// together, so that every projection stays what it was.

// [1 z] -> [1 + d'z, z], that is z -> z / (1 + d'z), and C = [m B] -> [m, B - m d'] (3 rows): a
// projective map, which moves the plane at infinity. It keeps away from the features where d is the
// mean c of the frames, as then depths 1 + c'z are 1 in the mean. Every frame, by a small step.
void CenterDepths(State& state);

// z -> L^-1 (z - mean), C -> [m + B mean, B L], with LL' the features' scatter (with their
// covariances): an affine map, after which the prior z ~ N(0, I) is their own distribution.
// Then every C over its scale.
void NormalizeCoordinates(State& state);

}  // namespace cohort::trajectory_model
