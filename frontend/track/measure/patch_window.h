#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

#include "frontend/image/lanes.h"
#include "frontend/image/sampling.h"

namespace cohort {

// An n x n window of a picture with its gradient [1/px]: the hot path of both passes, vectorised.
//
// The gradient is Scharr's, not that of the bilinear interpolant. The latter also responds to the
// interpolation blur, which varies with the sub-pixel phase and biases a minimum by tenths of a
// pixel. The mean over the window is removed, so that a constant brightness difference has no
// effect.
struct PatchWindow {
  static constexpr int kMostStride = RoundUpToLanes(kMaxPatchSide);

  int n = 0;
  int stride = 0;     // of rows; the padding after their n values is 0
  double mean = 0.0;  // of values
  alignas(32) float values[kMaxPatchSide * kMostStride];
  alignas(32) float dx[kMaxPatchSide * kMostStride];
  alignas(32) float dy[kMaxPatchSide * kMostStride];
};

// The window around x.
void FillWindow(const cv::Mat& picture, const Eigen::Vector2d& x, int n, PatchWindow& window);
// The value at offset u from the window's centre is the picture's at `center` + warp u.
void FillWarpedWindow(const cv::Mat& picture,
                      const Eigen::Vector2d& center,
                      const Eigen::Matrix2d& warp,
                      int n,
                      PatchWindow& window);

// Gauss-Newton for the translation x that minimises sum_u (I(x + u) - T(u) - mean)^2, with g the
// mean of both windows' gradients (efficient second-order minimisation).
struct TranslationEquations {
  Eigen::Matrix2d hessian;   // sum g g^T
  Eigen::Vector2d gradient;  // sum (I - T) g
  Eigen::Matrix2d cross;     // sum of the windows' gradients with each other, symmetric
};
TranslationEquations LinearizeTranslation(const cv::Mat& picture,
                                          const Eigen::Vector2d& x,
                                          const PatchWindow& window);

using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7d = Eigen::Matrix<double, 7, 7>;

// Least squares for a step of translation s, relative warp D = (d11 d12; d21 d22) and mean
// together: r(u) + g.s + g.(D u) - mean = 0. The gradient g is the mean of both windows'. The noise
// of a single window's gradient correlates with the same noise in r and would bias the scale.
struct WarpEquations {
  Matrix7d normal;
  Vector7d rhs;
  Eigen::Matrix2d cross;  // moments of the windows' gradients with each other
};
WarpEquations LinearizeWarp(const PatchWindow& seen, const PatchWindow& window);

// Sums over two windows, with the means removed except in `absolute`.
struct WindowComparison {
  double squares = 0.0;  // of seen
  double window_squares = 0.0;
  double products = 0.0;
  double absolute = 0.0;  // |seen - window|
};
WindowComparison CompareWindows(const PatchWindow& seen, const PatchWindow& window);

}  // namespace cohort
