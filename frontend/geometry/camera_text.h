#pragma once

#include <span>
#include <string>
#include <vector>

#include "frontend/geometry/camera.h"

namespace cohort {

// The text form of a camera, in `--camera` (with commas) and calibration.txt (with blanks).
inline constexpr char kCameraForm[] =
    "fx,fy,cx,cy and 0, 1, 2, 4, 5 or 8 of k1,k2,p1,p2,k3,k4,k5,k6, or "
    "fx,fy,cx,cy,fisheye,k1,k2,k3,k4";

// The camera of such words, without picture size. Throws Error that states what is missing.
Camera CameraFromWords(const std::vector<std::string>& words);

// The reverse, with as few coefficients as represent the camera exactly, but 4 if there are any.
std::vector<std::string> WordsOfCamera(const Camera& camera);

// `coefficients` in OpenCV's order: 0, 1, 2, 4, 5 or 8 of a pinhole, 4 of a fisheye. Throws Error.
Camera WithDistortion(Camera camera, CameraModel model, std::span<const double> coefficients);

}  // namespace cohort
