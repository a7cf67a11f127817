#pragma once

#include <Eigen/Core>
#include <optional>

#include "frontend/core/options.h"

namespace cohort {

enum class CameraModel { kPinhole, kFisheye };
inline constexpr ChoiceNames<CameraModel, 2> kCameraModelNames{
    {{"pinhole", CameraModel::kPinhole}, {"fisheye", CameraModel::kFisheye}}};

// The direction of the sensor's later rows in a picture: phones rotate upright video by a quarter.
enum class RowOrder { kDown, kLeft, kUp, kRight };
inline constexpr ChoiceNames<RowOrder, 4> kRowOrderNames{{{"down", RowOrder::kDown},
                                                          {"left", RowOrder::kLeft},
                                                          {"up", RowOrder::kUp},
                                                          {"right", RowOrder::kRight}}};

// OpenCV's cameras. With n = (X/Z, Y/Z), r = |n|:
//   xy  = (fx n_dx + cx, fy n_dy + cy)   [px], the centre of the top-left pixel is (0, 0)
//   pinhole (calib3d; COLMAP's FULL_OPENCV, without k3 to k6 its OPENCV):
//     n_d = n (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
//           + (2 p1 nx ny + p2 (r^2 + 2 nx^2), p1 (r^2 + 2 ny^2) + 2 p2 nx ny)
//   fisheye (cv::fisheye; COLMAP's OPENCV_FISHEYE), with theta = atan(r) and no other coefficients:
//     n_d = n / r theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
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
  double k3 = 0.0;
  double k4 = 0.0;
  double k5 = 0.0;
  double k6 = 0.0;
  CameraModel model = CameraModel::kPinhole;
  bool known = true;  // calibrated, kept fixed; false: a guess, to be refined
  // For a guess: standard deviation of log focal length; 1 means that nothing is known.
  double guess_log_sigma = 1.0;
  RowOrder row_order = RowOrder::kDown;  // for a rolling shutter

  // Pinhole without k3 to k6.
  bool HasAtMostFourCoefficients() const {
    return model == CameraModel::kPinhole && k3 == 0.0 && k4 == 0.0 && k5 == 0.0 && k6 == 0.0;
  }
  bool HasDistortion() const {
    return k1 != 0.0 || k2 != 0.0 || p1 != 0.0 || p2 != 0.0 || !HasAtMostFourCoefficients();
  }

  // The pixel of a point in the camera's frame; nullopt at or behind the camera.
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& x_in_cam) const;
  // The normalised image point n of a pixel, to 1e-12 in n_d; always finite for a fisheye and with
  // k3 to k6. If no ray within 89 degrees of the axis reaches the pixel, the result is one that
  // comes near.
  Eigen::Vector2d Unproject(const Eigen::Vector2d& xy) const;
  bool Contains(const Eigen::Vector2d& xy, double border_px = 0.0) const;

  // The usual guess without calibration: f = 1.2 max(width, height) and the centre of the picture,
  // as in COLMAP.
  static Camera Guess(int width_px, int height_px);
  // The same with a given focal length and its uncertainty.
  static Camera Guess(int width_px, int height_px, double focal_px, double log_sigma);
};

// n_d of n, for any camera, and its derivatives.
struct DistortedPoint {
  Eigen::Vector2d n_d;
  Eigen::Matrix2d d_n;
  Eigen::Matrix2d d_k1_k2;  // a column each
};
DistortedPoint Distort(const Camera& camera, const Eigen::Vector2d& n);

}  // namespace cohort
