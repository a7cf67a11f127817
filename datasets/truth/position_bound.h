#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "datasets/degrade/degrade.h"

namespace cohort {

// How well a patch of a degraded frame can be located at all: the Cramer-Rao bound of its
// translation [px] against a template without noise,
//   covariance = F^-1,   F = J^T C^-1 J,
// with J (pixels x 2) the gradient of NoiseFreeSignal in the window and C the covariance of its
// pixels' noise, rounding to 8 bits included (position_bound.cc). Clipping at black and white is
// left out: it can only lose, so the bound stays one. Not for recipe phone, whose frames tell of
// those before them.
class PositionBound {
 public:
  PositionBound(const DegradeOptions& options, int window_px);

  // What the bound reads of a frame.
  struct Signal {
    cv::Mat value;  // CV_32FC1
    cv::Mat dx;
    cv::Mat dy;
  };
  static Signal Prepare(const cv::Mat& signal);

  // [px^2], of the window about the pixel nearest to `xy`; none where it has no texture. Outside
  // the picture nothing is seen.
  std::optional<Eigen::Matrix2d> Covariance(const Signal& signal, const Eigen::Vector2d& xy) const;

 private:
  DegradeRecipe recipe_;
  int half_px_;
  double shot_ = 0.0;
  double read_ = 0.0;
  Eigen::MatrixXd whitening_;  // L^-1, C = L L^T; paper
};

}  // namespace cohort
