#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

namespace cohort {

// Pinhole camera with OpenCV's distortion (COLMAP's OPENCV model). With n = (X/Z, Y/Z), r2 = |n|^2:
//   n_d = n (1 + k1 r2 + k2 r2^2) + (2 p1 nx ny + p2 (r2 + 2 nx^2), p1 (r2 + 2 ny^2) + 2 p2 nx ny)
//   xy  = (fx n_dx + cx, fy n_dy + cy)   [px], the centre of the top-left pixel is (0, 0)
struct Camera {
  int width_px = 0;
  int height_px = 0;
  double fx = 0.0;
  double fy = 0.0;
  double cx = 0.0;
  double cy = 0.0;
  double k1 = 0.0;
  double k2 = 0.0;
  double p1 = 0.0;
  double p2 = 0.0;
  bool known = true;  // calibrated, kept fixed; false: a guess, to be refined

  bool HasDistortion() const { return k1 != 0.0 || k2 != 0.0 || p1 != 0.0 || p2 != 0.0; }

  // The pixel of a point in the camera's frame; none at or behind the camera.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& x_in_cam) const;
  // The normalised image point n of a pixel (fixed-point iteration and Newton, to 1e-12).
  Eigen::Vector2d Unproject(const Eigen::Vector2d& xy) const;
  bool Contains(const Eigen::Vector2d& xy, double border_px = 0.0) const;

  // The usual guess without calibration: f = 1.2 max(width, height), centre of the picture, as
  // COLMAP's.
  static Camera Guess(int width_px, int height_px);
};

}  // namespace cohort
