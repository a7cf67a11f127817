#pragma once

#include <string>

#include "frontend/geometry/camera.h"

namespace cohort {

// The longest side of a picture that is read from files.
inline constexpr int kMaxPictureSidePx = 1 << 20;

// Describes values in a file that no camera can have: numbers that are not finite, focal lengths or
// their uncertainty not above 0, a side below 0 or above kMaxPictureSidePx. Empty if there are
// none.
std::string FaultOf(const Camera& camera);

}  // namespace cohort
