#pragma once

#include <string>

#include "frontend/geometry/camera.h"

namespace cohort {

// The longest side of a picture that is read from files.
inline constexpr int kMaxPictureSidePx = 1 << 20;

// What no camera can have and a file may say: numbers that are not finite, focal lengths or an
// uncertainty of them not above 0, a side below 0 or above kMaxPictureSidePx. Empty: nothing.
std::string FaultOf(const Camera& camera);

}  // namespace cohort
