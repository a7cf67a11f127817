#include "datasets/truth/position_bound.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace cohort {
namespace {

constexpr double kRoundingVariance = 1.0 / (12.0 * 255.0 * 255.0);

// sum_k w_k w_(k + d) of the kernel that cv::GaussianBlur uses for float pictures.
std::vector<double> Autocorrelation(double sigma_px, int longest) {
  std::vector<double> result(static_cast<std::size_t>(longest) + 1, 0.0);
  result[0] = 1.0;
  if (sigma_px <= 0.0) return result;
  const cv::Mat kernel = cv::getGaussianKernel(
      static_cast<int>(std::lround(8.0 * sigma_px + 1.0)) | 1, sigma_px, CV_64F);
  for (int d = 0; d <= longest; ++d) {
    double sum = 0.0;
    for (int k = 0; k + d < kernel.rows; ++k) {
      sum += kernel.at<double>(k) * kernel.at<double>(k + d);
    }
    result[static_cast<std::size_t>(d)] = sum;
  }
  return result;
}

}  // namespace

// C, the covariance of the noise of a window's pixels:
//   paper   C_ij = s1^2 a(x_i - x_j) a(y_i - y_j) + (s2^2 + q^2) [i = j], a: autocorrelation of the
//           blur's kernel; so the noise that is blurred with the picture counts with its exact
//           correlation, not as white noise of some effective size
//   sensor  C_ii = v_i = shot s_i + read in linear light, where noise is independent; the variance
//           depends on the signal too, so F has 1 / v + shot^2 / (2 v^2) instead of 1 / v
// q^2 = 1 / (12 255^2): the rounding to 8 bits.
PositionBound::PositionBound(const DegradeOptions& options, int window_px)
    : recipe_(options.recipe), half_px_(window_px / 2) {
  Check(recipe_ != DegradeRecipe::kPhone, "the noise of a phone's video is unknown");
  if (recipe_ == DegradeRecipe::kSensor) {
    const SensorLevel level = SensorLevelAt(options.level, options.light);
    shot_ = level.shot;
    // Rounding happens after digital gain and gamma; in linear light it is smallest in the dark.
    read_ = level.read;
    return;
  }
  const PaperLevel level = PaperLevelAt(options.level);
  const int side = 2 * half_px_ + 1;
  const std::vector<double> a = Autocorrelation(level.blur_px, side);
  Eigen::MatrixXd C(side * side, side * side);
  for (int i = 0; i < C.rows(); ++i) {
    for (int j = 0; j < C.cols(); ++j) {
      const auto dx = static_cast<std::size_t>(std::abs(i % side - j % side));
      const auto dy = static_cast<std::size_t>(std::abs(i / side - j / side));
      C(i, j) = level.noise_before * level.noise_before * a[dx] * a[dy];
    }
    C(i, i) += level.noise_after * level.noise_after + kRoundingVariance;
  }
  const Eigen::LLT<Eigen::MatrixXd> cholesky(C);
  Check(cholesky.info() == Eigen::Success, "a noise covariance is positive definite");
  whitening_ = cholesky.matrixL().solve(Eigen::MatrixXd::Identity(C.rows(), C.cols()));
}

PositionBound::Signal PositionBound::Prepare(const cv::Mat& signal) {
  const cv::Mat central = (cv::Mat_<float>(1, 3) << -0.5F, 0.0F, 0.5F);
  Signal result{signal, {}, {}};
  cv::filter2D(signal, result.dx, CV_32F, central);
  cv::filter2D(signal, result.dy, CV_32F, central.t());
  return result;
}

std::optional<Eigen::Matrix2d> PositionBound::Covariance(const Signal& signal,
                                                         const Eigen::Vector2d& xy) const {
  const int side = 2 * half_px_ + 1;
  const auto x0 = static_cast<int>(std::lround(xy.x()));
  const auto y0 = static_cast<int>(std::lround(xy.y()));
  Eigen::MatrixX2d J = Eigen::MatrixX2d::Zero(side * side, 2);
  const cv::Rect picture(0, 0, signal.value.cols, signal.value.rows);
  for (int i = 0; i < J.rows(); ++i) {
    const cv::Point at(x0 + i % side - half_px_, y0 + i / side - half_px_);
    if (!picture.contains(at)) continue;
    J.row(i) << signal.dx.at<float>(at), signal.dy.at<float>(at);
    if (recipe_ == DegradeRecipe::kSensor) {
      const double variance = shot_ * signal.value.at<float>(at) + read_;
      J.row(i) *= std::sqrt(1.0 / variance + shot_ * shot_ / (2.0 * variance * variance));
    }
  }
  if (recipe_ == DegradeRecipe::kPaper) J = whitening_.triangularView<Eigen::Lower>() * J;
  const Eigen::Matrix2d F = J.transpose() * J;
  if (!(F.determinant() > 1e-12 * F.trace() * F.trace())) return std::nullopt;
  return F.inverse();
}

}  // namespace cohort
