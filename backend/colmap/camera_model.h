#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "frontend/geometry/camera.h"

namespace cohort {

// COLMAP's origin is the corner of the top-left pixel, ours its centre. This is the only shift.
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

// A row of COLMAP's cameras table, in its pixels.
struct ColmapCamera {
  ColmapCameraModel model = ColmapCameraModel::kPinhole;
  int width_px = 0;
  int height_px = 0;
  std::vector<double> params;
  bool prior_focal_length = true;  // calibrated

  bool operator==(const ColmapCamera&) const = default;
};

// PINHOLE; with distortion OPENCV, with k3 to k6 FULL_OPENCV; a fisheye is OPENCV_FISHEYE. A
// guessed camera has no prior focal length. If it has one focal length and neither p1 nor p2, it is
// SIMPLE_RADIAL, or with k2 RADIAL, instead of PINHOLE and OPENCV.
ColmapCamera ToColmapCamera(const Camera& camera);
// `camera` in the model of `before`, or if that has too few parameters, in the first of the above
// that has enough.
ColmapCamera ToColmapCamera(const Camera& camera, const ColmapCamera& before);
// The result is `known`. Throws Error on another model or a wrong number of parameters.
Camera FromColmapCamera(const ColmapCamera& colmap);

// Whether both project every ray of the picture to the same place within a tenth of a pixel,
// whatever their models: no feature is that accurate. Throws Error on invalid parameters.
bool AreAsOne(const ColmapCamera& a, const ColmapCamera& b);
// The focal length of `camera` divided by that of `reference`; nullopt if they differ otherwise by
// more than AreAsOne allows.
std::optional<double> FocalScaleOf(const ColmapCamera& camera, const ColmapCamera& reference);

// Whether COLMAP refines all parameters of such a camera by default, wherever its first value came
// from. This holds for models with one focal length; the others come from a calibration.
bool IsFoundByColmap(ColmapCameraModel model);
// Whether it looks like COLMAP's initial guess, without anything that a calibration adds to a focal
// length: no distortion in a model that has some, one focal length, principal point in the middle.
bool IsStartOfColmap(const ColmapCamera& camera);

std::string ColmapModelName(ColmapCameraModel model);
ColmapCameraModel ColmapModelFromName(const std::string& name);  // throws Error

std::size_t ColmapParameterCount(ColmapCameraModel model);  // throws Error on an unknown model

}  // namespace cohort
