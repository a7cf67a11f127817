#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "datasets/degrade/degrade.h"

namespace cohort {

// The limit of locating a patch of a degraded frame: the Cramer-Rao bound of its translation [px]
// against a template without noise,
//   covariance = F^-1,   F = J^T C^-1 J,
// with J (pixels x 2) the gradient of NoiseFreeSignal in the window and C the covariance of its
// pixels' noise, including rounding to 8 bits (position_bound.cc). Clipping at black and white is
// ignored: it only loses information, so the bound remains valid. Not for recipe phone, whose
// frames depend on earlier ones.
class PositionBound {
 public:
  PositionBound(const DegradeOptions& options, int window_px);

  // The part of a frame that the bound uses.
  struct Signal {
    cv::Mat value;  // CV_32FC1
    cv::Mat dx;
    cv::Mat dy;
  };
  static Signal Prepare(const cv::Mat& signal);

  // [px^2], for the window about the pixel nearest to `xy`; nullopt without texture. Pixels outside
  // the picture carry no information.
  std::optional<Eigen::Matrix2d> Covariance(const Signal& signal, const Eigen::Vector2d& xy) const;

 private:
  DegradeRecipe recipe_;
  int half_px_;
  double shot_ = 0.0;
  double read_ = 0.0;
  Eigen::MatrixXd whitening_;  // L^-1, C = L L^T; paper
};

}  // namespace cohort
