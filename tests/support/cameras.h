#pragma once

#include <array>

#include "frontend/geometry/camera.h"

namespace cohort::test {

// All that a camera is but its size and model: what must come back from a file.
inline constexpr std::array kCameraNumbers{&Camera::fx,
                                           &Camera::fy,
                                           &Camera::cx,
                                           &Camera::cy,
                                           &Camera::k1,
                                           &Camera::k2,
                                           &Camera::p1,
                                           &Camera::p2,
                                           &Camera::k3,
                                           &Camera::k4,
                                           &Camera::k5,
                                           &Camera::k6};

// The colour camera of TUM's freiburg1, as the data set's page gives it.
inline Camera FreiburgCamera() {
  return {.width_px = 640,
          .height_px = 480,
          .fx = 517.3,
          .fy = 516.5,
          .cx = 318.6,
          .cy = 255.3,
          .k1 = 0.2624,
          .k2 = -0.9531,
          .p1 = -0.0054,
          .p2 = 0.0026,
          .k3 = 1.1633};
}

// A lens of 8 coefficients with barrel distortion, 105 degrees from corner to corner.
inline Camera RationalCamera() {
  return {.width_px = 640,
          .height_px = 576,
          .fx = 504.7,
          .fy = 504.5,
          .cx = 322.0,
          .cy = 286.0,
          .k1 = 1.67,
          .k2 = 1.09,
          .p1 = 0.0004,
          .p2 = -0.0007,
          .k3 = 0.057,
          .k4 = 2.0,
          .k5 = 1.68,
          .k6 = 0.296};
}

// 120 degrees from the left to the right border, 148 from corner to corner.
inline Camera FisheyeCamera() {
  return {.width_px = 640,
          .height_px = 480,
          .fx = 305.0,
          .fy = 304.0,
          .cx = 321.5,
          .cy = 238.0,
          .k1 = -0.012,
          .k2 = 0.006,
          .k3 = -0.004,
          .k4 = 0.0008,
          .model = CameraModel::kFisheye};
}

}  // namespace cohort::test
