#include "frontend/geometry/camera_fault.h"

#include <cmath>

namespace cohort {

std::string FaultOf(const Camera& camera) {
  for (const double number : {camera.fx,
                              camera.fy,
                              camera.cx,
                              camera.cy,
                              camera.k1,
                              camera.k2,
                              camera.p1,
                              camera.p2,
                              camera.k3,
                              camera.k4,
                              camera.k5,
                              camera.k6,
                              camera.guess_log_sigma}) {
    if (!std::isfinite(number)) return "a number of its camera is not finite";
  }
  if (camera.fx <= 0.0 || camera.fy <= 0.0) {
    return fmt::format("focal lengths of {} and {} px are not above 0", camera.fx, camera.fy);
  }
  if (camera.guess_log_sigma <= 0.0) {
    return fmt::format("an uncertainty of {} of its focal length is not above 0",
                       camera.guess_log_sigma);
  }
  constexpr double kMost = 1e12;
  for (const double px : {camera.fx, camera.fy, std::abs(camera.cx), std::abs(camera.cy)}) {
    if (px > kMost) return fmt::format("{} px are more than any camera has", px);
  }
  for (const int side : {camera.width_px, camera.height_px}) {
    if (side < 0 || side > kMaxPictureSidePx) {
      return fmt::format(
          "a picture has a side of {} px: 0 to {} are supported", side, kMaxPictureSidePx);
    }
  }
  return {};
}

}  // namespace cohort
