#include "frontend/image/frame_offset.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "frontend/core/error.h"
#include "frontend/core/part_times.h"

namespace cohort {
namespace {

struct Difference {
  double mean = 0.0;
  Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
};

// Over the overlap of both pictures.
Difference DifferenceAt(const cv::Mat& previous, const cv::Mat& current, const Eigen::Vector2d& d) {
  const int x0 = static_cast<int>(std::floor(d.x()));
  const int y0 = static_cast<int>(std::floor(d.y()));
  const auto a = static_cast<float>(d.x() - x0);
  const auto b = static_cast<float>(d.y() - y0);
  const int left = std::max(0, -x0);
  const int right = std::min(previous.cols, current.cols - 1 - x0);
  const int top = std::max(0, -y0);
  const int bottom = std::min(previous.rows, current.rows - 1 - y0);
  Difference difference;
  if (right - left < previous.cols / 4 || bottom - top < previous.rows / 4) {
    difference.mean = 1e9;  // hardly any overlap: not a candidate
    return difference;
  }
  double sum = 0.0;
  double gx = 0.0;
  double gy = 0.0;
  for (int y = top; y < bottom; ++y) {
    const float* p = previous.ptr<float>(y);
    const float* upper = current.ptr<float>(y + y0) + x0;
    const float* lower = current.ptr<float>(y + y0 + 1) + x0;
    for (int x = left; x < right; ++x) {
      const float u = upper[x] + a * (upper[x + 1] - upper[x]);
      const float l = lower[x] + a * (lower[x + 1] - lower[x]);
      const float r = u + b * (l - u) - p[x];
      const float dx =
          (upper[x + 1] - upper[x]) + b * ((lower[x + 1] - lower[x]) - (upper[x + 1] - upper[x]));
      const float sign = static_cast<float>((r > 0.0F) - (r < 0.0F));
      sum += std::abs(r);
      gx += sign * dx;
      gy += sign * (l - u);
    }
  }
  const double area = static_cast<double>(right - left) * (bottom - top);
  difference.mean = sum / area;
  difference.gradient = Eigen::Vector2d(gx, gy) / area;
  return difference;
}

// Gradient descent with a step that halves when it no longer helps.
std::pair<Eigen::Vector2d, double> Descend(const cv::Mat& previous,
                                           const cv::Mat& current,
                                           Eigen::Vector2d d) {
  Difference at = DifferenceAt(previous, current, d);
  double step = 1.0;
  for (int i = 0; i < 60 && step > 0.02; ++i) {
    const double norm = at.gradient.norm();
    if (norm == 0.0) break;
    const Eigen::Vector2d trial = d - step / norm * at.gradient;
    const Difference there = DifferenceAt(previous, current, trial);
    if (there.mean < at.mean) {
      d = trial;
      at = there;
      step *= 1.3;
    } else {
      step *= 0.5;
    }
  }
  return {d, at.mean};
}

}  // namespace

Eigen::Vector2d RegisterFrames(const Pyramid& previous, const Pyramid& current) {
  const TimedPart part("registration");
  Check(!previous.levels.empty() && previous.levels.size() == current.levels.size(),
        "RegisterFrames takes pyramids of the same size");
  const cv::Mat& from = previous.levels.back();
  const cv::Mat& to = current.levels.back();
  // No pyramid is smaller, and phaseCorrelate() does not accept less.
  constexpr int kLeastSide = 16;
  if (std::min(from.cols, from.rows) < kLeastSide) return Eigen::Vector2d::Zero();
  const double scale = std::ldexp(1.0, static_cast<int>(previous.levels.size()) - 1);
  const cv::Point2d peak = cv::phaseCorrelate(from, to);
  auto best = Descend(from, to, Eigen::Vector2d::Zero());
  if (std::isfinite(peak.x) && std::isfinite(peak.y)) {
    const auto other = Descend(from, to, {peak.x, peak.y});
    if (other.second < best.second) best = other;
  }
  return scale * best.first;
}

}  // namespace cohort
