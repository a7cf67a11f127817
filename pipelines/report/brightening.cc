#include "pipelines/report/brightening.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "frontend/core/statistics.h"

namespace cohort {

IntensityRange IntensityRangeOf(const cv::Mat& gray) {
  constexpr double kTail = 0.005;
  // A sample of a large picture suffices.
  constexpr double kMostPixels = 100'000.0;
  const double scale =
      1.0 / std::max(1.0, std::floor(std::sqrt(static_cast<double>(gray.total()) / kMostPixels)));
  cv::Mat sample;
  cv::resize(gray, sample, {}, scale, scale, cv::INTER_NEAREST);
  sample.reshape(1, 1).convertTo(sample, CV_64F);
  const std::vector<double> values(sample.begin<double>(), sample.end<double>());
  const double dark = Quantile(values, kTail);
  return {dark, std::max(Quantile(values, 1.0 - kTail), dark + 1.0)};
}

namespace {

// Local linear regression: every value is replaced by that of the line that fits its neighbours
// best, with Gaussian weights by distance. A mean would lag where the values rise or fall towards
// the end.
std::vector<double> Smoothed(const std::vector<double>& values, double sigma) {
  const auto count = static_cast<int>(values.size());
  const int reach = static_cast<int>(std::ceil(3.0 * sigma));
  std::vector<double> smoothed;
  for (int i = 0; i < count; ++i) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (int j = std::max(0, i - reach); j <= std::min(count - 1, i + reach); ++j) {
      const double distance = (j - i) / std::max(sigma, 1e-9);
      const Eigen::Vector2d basis(1.0, distance);
      const double weight = std::exp(-0.5 * distance * distance);
      normal += weight * basis * basis.transpose();
      right += weight * basis * values[static_cast<std::size_t>(j)];
    }
    normal(1, 1) += 1e-9;  // a single frame has no slope
    smoothed.push_back(normal.ldlt().solve(right).x());
  }
  return smoothed;
}

}  // namespace

std::vector<IntensityRange> Steadied(const std::vector<IntensityRange>& of_frames,
                                     double sigma_frames) {
  // The darkest and the brightest of the neighbours, so that no frame is brightened further than on
  // its own because of a dull neighbour.
  const auto count = static_cast<int>(of_frames.size());
  const int reach = static_cast<int>(std::ceil(1.5 * sigma_frames));
  std::vector<double> dark;
  std::vector<double> span;
  for (int i = 0; i < count; ++i) {
    IntensityRange widest = of_frames[static_cast<std::size_t>(i)];
    for (int j = std::max(0, i - reach); j <= std::min(count - 1, i + reach); ++j) {
      widest.dark = std::min(widest.dark, of_frames[static_cast<std::size_t>(j)].dark);
      widest.bright = std::max(widest.bright, of_frames[static_cast<std::size_t>(j)].bright);
    }
    dark.push_back(std::log(widest.dark + 1.0));
    span.push_back(std::log(widest.bright - widest.dark));
  }
  dark = Smoothed(dark, sigma_frames);
  span = Smoothed(span, sigma_frames);
  std::vector<IntensityRange> steadied;
  for (std::size_t i = 0; i < of_frames.size(); ++i) {
    const double darkest = std::exp(dark[i]) - 1.0;
    steadied.push_back({darkest, darkest + std::exp(span[i])});
  }
  return steadied;
}

cv::Mat Brightened(const cv::Mat& gray, const IntensityRange& range) {
  constexpr double kBrightest = 190.0;  // below white, so that marks remain visible
  constexpr double kMostBeyond = 1.15;  // of the brightest 0.5 %
  constexpr double kGamma = 0.75;       // lamps leave little of the range to the unlit parts
  const double factor = 1.0 / (range.bright - range.dark);
  cv::Mat share;
  gray.convertTo(share, CV_32F, factor, -range.dark * factor);
  share = cv::min(cv::max(share, 0.0), kMostBeyond);
  cv::pow(share, kGamma, share);
  cv::Mat eight_bit;
  share.convertTo(eight_bit, CV_8U, kBrightest);
  cv::Mat color;
  cv::cvtColor(eight_bit, color, cv::COLOR_GRAY2BGR);
  return color;
}

}  // namespace cohort
