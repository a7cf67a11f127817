#pragma once

#include <Eigen/Core>

#include "frontend/image/pyramid.h"

namespace cohort {

// Whole-frame registration (paper 3.3): the shift d [px at full resolution] that minimises mean
// |I(x + d) - I_prev(x)| over the coarsest level, by gradient descent from several starts (no shift
// and phase correlation); the best result is kept. A point at x in `previous` is near x + d in
// `current`. Returns no shift for pictures of less than 16 px a side.
Eigen::Vector2d RegisterFrames(const Pyramid& previous, const Pyramid& current);

}  // namespace cohort
