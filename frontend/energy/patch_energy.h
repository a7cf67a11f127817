#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <span>

namespace cohort {

// Single-feature energy, paper equation (1) with psi = |.|, per pixel:
//   c(x) = 1/n^2 sum_u |T(u) - I(u + x)|,   T, I in 0..1, x [px of the picture's level]
// `patch` is T, n x n row by row. I is interpolated bilinearly.
double PatchEnergy(const cv::Mat& picture,
                   const Eigen::Vector2d& x,
                   std::span<const float> patch,
                   int n);

struct PatchGradient {
  double energy = 0.0;
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();  // dc/dx [1/px]: 1/n^2 sum sign(I - T) grad I
};
PatchGradient PatchEnergyGradient(const cv::Mat& picture,
                                  const Eigen::Vector2d& x,
                                  std::span<const float> patch,
                                  int n);

// The quadratic that touches c at x from above, |r| <= r^2 / (2 |r0|) + |r0| / 2, with linearised
// residuals (iteratively re-weighted least squares): c(x + d) ~ energy + gradient d + d' hessian d
// / 2. |r0| is bounded below by `floor`, which keeps the weights finite.
struct PatchQuadratic {
  double energy = 0.0;
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
  Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();
};
PatchQuadratic PatchEnergyQuadratic(const cv::Mat& picture,
                                    const Eigen::Vector2d& x,
                                    std::span<const float> patch,
                                    int n,
                                    double floor);

}  // namespace cohort
