#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "frontend/geometry/camera.h"

namespace cohort {

// COLMAP puts the origin at the corner of the top-left pixel, we at its centre: the only shift.
inline constexpr double kColmapPixelShift = 0.5;

enum class ColmapCameraModel : std::int32_t {
  kSimplePinhole = 0,        // f cx cy
  kPinhole = 1,              // fx fy cx cy
  kSimpleRadial = 2,         // f cx cy k1
  kRadial = 3,               // f cx cy k1 k2
  kOpencv = 4,               // fx fy cx cy k1 k2 p1 p2
  kOpencvFisheye = 5,        // fx fy cx cy k1 k2 k3 k4
  kFullOpencv = 6,           // fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6
  kSimpleRadialFisheye = 8,  // f cx cy k1
  kRadialFisheye = 9,        // f cx cy k1 k2
};

// A row of COLMAP's cameras, in its pixels.
struct ColmapCamera {
  ColmapCameraModel model = ColmapCameraModel::kPinhole;
  int width_px = 0;
  int height_px = 0;
  std::vector<double> params;
  bool prior_focal_length = true;  // calibrated

  bool operator==(const ColmapCamera&) const = default;
};

// PINHOLE, with distortion OPENCV, with k3 to k6 FULL_OPENCV, a fisheye OPENCV_FISHEYE. A guessed
// camera has no prior focal length and, where it has one focal length and neither p1 nor p2, is
// SIMPLE_RADIAL or with k2 RADIAL instead of PINHOLE and OPENCV.
ColmapCamera ToColmapCamera(const Camera& camera);
// `camera` as the same model as `before` or, where that has too few parameters for it, as the first of
// the above that has not.
ColmapCamera ToColmapCamera(const Camera& camera, const ColmapCamera& before);
// As `known`. Throws Error on a model or a number of parameters that is not one of the above.
Camera FromColmapCamera(const ColmapCamera& colmap);

// By how much the focal length of `camera` is that of `reference`; none where they differ in more.
std::optional<double> FocalScaleOf(const ColmapCamera& camera, const ColmapCamera& reference);

// Does COLMAP refine all of such a camera by itself, wherever its first value came from? Those of
// one focal length; who has a calibration gives the others.
bool IsFoundByColmap(ColmapCameraModel model);
// Is it where COLMAP starts, as far as a calibration tells more than a focal length: without
// distortion in a model that has some, one focal length, the principal point in the middle?
bool IsStartOfColmap(const ColmapCamera& camera);

std::string ColmapModelName(ColmapCameraModel model);
ColmapCameraModel ColmapModelFromName(const std::string& name);  // throws Error

std::size_t ColmapParameterCount(ColmapCameraModel model);  // throws Error on an unknown model

}  // namespace cohort
