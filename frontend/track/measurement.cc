#include "frontend/track/measurement.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "frontend/image/sampling.h"

namespace cohort {
namespace {

// Gauss-Newton on one level; `x` in px of the level. Stops when a step is below 0.01 px.
bool Align(const cv::Mat& picture,
           const std::vector<float>& patch,
           int n,
           int max_iterations,
           Eigen::Vector2d& x,
           Measurement& measurement) {
  const int area = n * n;
  float values[kMaxPatchArea];
  float dx[kMaxPatchArea];
  float dy[kMaxPatchArea];
  for (int i = 0; i < max_iterations; ++i) {
    SamplePatchWithGradient(picture, x.x(), x.y(), n, values, dx, dy);
    // Sums for the normal equations of (x, mean difference), the mean eliminated.
    float sr = 0, sx = 0, sy = 0, srx = 0, sry = 0, sxx = 0, sxy = 0, syy = 0;
    for (int k = 0; k < area; ++k) {
      const float r = values[k] - patch[k];
      sr += r;
      sx += dx[k];
      sy += dy[k];
      srx += r * dx[k];
      sry += r * dy[k];
      sxx += dx[k] * dx[k];
      sxy += dx[k] * dy[k];
      syy += dy[k] * dy[k];
    }
    const double inverse = 1.0 / area;
    Eigen::Matrix2d H;
    H << sxx - sx * sx * inverse, sxy - sx * sy * inverse, 0.0, syy - sy * sy * inverse;
    H(1, 0) = H(0, 1);
    const Eigen::Vector2d g(srx - sr * sx * inverse, sry - sr * sy * inverse);
    measurement.gradient_energy = H;
    const double determinant = H.determinant();
    if (!(determinant > 1e-12)) return false;
    Eigen::Vector2d step = -H.inverse() * g;
    const double length = step.norm();
    if (!std::isfinite(length)) return false;
    if (length > 2.0) step *= 2.0 / length;
    x += step;
    if (length < 0.01) return true;
  }
  return true;  // slow is not wrong: the tests on the result decide
}

}  // namespace

AnchorPatch TakeAnchor(const Pyramid& pyramid, const Eigen::Vector2d& xy, int window_px) {
  const int area = window_px * window_px;
  AnchorPatch anchor;
  anchor.full.resize(static_cast<std::size_t>(area));
  SamplePatch(pyramid.levels[0], xy.x(), xy.y(), window_px, anchor.full.data());
  if (pyramid.levels.size() > 1) {
    anchor.half.resize(static_cast<std::size_t>(area));
    SamplePatch(pyramid.levels[1], xy.x() / 2, xy.y() / 2, window_px, anchor.half.data());
  }
  double sum = 0.0;
  double square = 0.0;
  for (const float v : anchor.full) {
    sum += v;
    square += static_cast<double>(v) * v;
  }
  anchor.signal_variance = std::max(0.0, square / area - sum * sum / area / area);
  return anchor;
}

Measurement MeasurePatch(const Pyramid& current,
                         const AnchorPatch& anchor,
                         const Eigen::Vector2d& guide,
                         int window_px) {
  const int n = window_px;
  const int area = n * n;
  Measurement measurement;
  measurement.xy = guide;
  if (!anchor.half.empty()) {
    Eigen::Vector2d half = guide / 2;
    // Where the half resolution leads astray, the full one starts from the guide.
    if (Align(current.levels[1], anchor.half, n, 10, half, measurement) &&
        (2 * half - guide).norm() < 6.0) {
      measurement.xy = 2 * half;
    }
  }
  measurement.converged = Align(current.levels[0], anchor.full, n, 15, measurement.xy, measurement);

  float values[kMaxPatchArea];
  SamplePatch(current.levels[0], measurement.xy.x(), measurement.xy.y(), n, values);
  double sv = 0, st = 0, svv = 0, stt = 0, svt = 0, sabs = 0;
  for (int k = 0; k < area; ++k) {
    const double v = values[k];
    const double t = anchor.full[static_cast<std::size_t>(k)];
    sv += v;
    st += t;
    svv += v * v;
    stt += t * t;
    svt += v * t;
    sabs += std::abs(v - t);
  }
  const double cvv = svv - sv * sv / area;
  const double ctt = stt - st * st / area;
  const double cvt = svt - sv * st / area;
  measurement.correlation = cvv > 0.0 && ctt > 0.0 ? cvt / std::sqrt(cvv * ctt) : 0.0;
  measurement.residual_variance = std::max(0.0, (cvv + ctt - 2.0 * cvt) / area);
  measurement.residual = sabs / area;
  return measurement;
}

}  // namespace cohort
