#include "frontend/image/sampling.h"

#include <algorithm>
#include <cmath>

#include "frontend/image/lanes.h"

namespace cohort {
namespace {

// The (n + 1) x (columns + 1) pixels that a patch needs: in place where it lies inside the picture,
// else copied with the border repeated.
struct Pixels {
  const float* data;
  std::ptrdiff_t stride;
  float a;  // sub-pixel weights
  float b;
};

Pixels Gather(const cv::Mat& picture, double x, double y, int n, int columns, float* copy) {
  const double left = x - n / 2;
  const double top = y - n / 2;
  // Far outside, the position only has to stay representable.
  const int x0 = static_cast<int>(std::floor(std::clamp(left, -1e6, 1e6)));
  const int y0 = static_cast<int>(std::floor(std::clamp(top, -1e6, 1e6)));
  const auto a = static_cast<float>(std::clamp(left - x0, 0.0, 1.0));
  const auto b = static_cast<float>(std::clamp(top - y0, 0.0, 1.0));
  const auto stride = static_cast<std::ptrdiff_t>(picture.step1());
  if (x0 >= 0 && y0 >= 0 && x0 + columns < picture.cols && y0 + n < picture.rows) {
    return {picture.ptr<float>(y0) + x0, stride, a, b};
  }
  for (int r = 0; r <= n; ++r) {
    const float* row = picture.ptr<float>(std::clamp(y0 + r, 0, picture.rows - 1));
    for (int c = 0; c <= columns; ++c) {
      copy[r * (columns + 1) + c] = row[std::clamp(x0 + c, 0, picture.cols - 1)];
    }
  }
  return {copy, columns + 1, a, b};
}

constexpr int kGatherSize = (kMaxPatchSide + 1) * (RoundUpToLanes(kMaxPatchSide) + 1);

COHORT_SIMD_CLONES void Interpolate(const Pixels& pixels, int n, float* values, int stride) {
  for (int r = 0; r < n; ++r) {
    const float* p = pixels.data + r * pixels.stride;
    const float* q = p + pixels.stride;
    for (int k = 0; k < n; k += kLanes) {
      const FloatLanes p0 = LoadLanes(p + k);
      const FloatLanes q0 = LoadLanes(q + k);
      const FloatLanes upper = p0 + pixels.a * (LoadLanes(p + k + 1) - p0);
      const FloatLanes lower = q0 + pixels.a * (LoadLanes(q + k + 1) - q0);
      StoreLanes(upper + pixels.b * (lower - upper), values + r * stride + k);
    }
  }
}

// The gradient is that of the interpolant.
COHORT_SIMD_CLONES void InterpolateWithGradient(
    const Pixels& pixels, int n, float* values, float* dx, float* dy, int stride) {
  for (int r = 0; r < n; ++r) {
    const float* p = pixels.data + r * pixels.stride;
    const float* q = p + pixels.stride;
    for (int k = 0; k < n; k += kLanes) {
      const FloatLanes p0 = LoadLanes(p + k);
      const FloatLanes q0 = LoadLanes(q + k);
      const FloatLanes upper_step = LoadLanes(p + k + 1) - p0;
      const FloatLanes lower_step = LoadLanes(q + k + 1) - q0;
      const FloatLanes upper = p0 + pixels.a * upper_step;
      const FloatLanes lower = q0 + pixels.a * lower_step;
      const int at = r * stride + k;
      StoreLanes(upper + pixels.b * (lower - upper), values + at);
      StoreLanes(upper_step + pixels.b * (lower_step - upper_step), dx + at);
      StoreLanes(lower - upper, dy + at);
    }
  }
}

// A row of a warped window from (x0, y0) on, in steps of (step_x, step_y).
COHORT_SIMD_CLONES void InterpolateAlong(const float* picture,
                                         int stride,
                                         int last_x,
                                         int last_y,
                                         float x0,
                                         float y0,
                                         float step_x,
                                         float step_y,
                                         int n,
                                         float* values) {
  const int half = n / 2;
  const FloatLanes zero{};
  const FloatLanes one = zero + 1.0F;
  for (int k = 0; k < n; k += kLanes) {
    const FloatLanes u = LaneNumbers() + static_cast<float>(k - half);
    const FloatLanes x = x0 + step_x * u;
    const FloatLanes y = y0 + step_y * u;
    IntLanes xi = __builtin_convertvector(x, IntLanes);
    IntLanes yi = __builtin_convertvector(y, IntLanes);
    xi = xi < 0 ? IntLanes{} : xi;
    yi = yi < 0 ? IntLanes{} : yi;
    xi = xi > last_x ? IntLanes{} + last_x : xi;
    yi = yi > last_y ? IntLanes{} + last_y : yi;
    FloatLanes a = x - __builtin_convertvector(xi, FloatLanes);
    FloatLanes b = y - __builtin_convertvector(yi, FloatLanes);
    a = a < zero ? zero : a;
    b = b < zero ? zero : b;
    a = a > one ? one : a;
    b = b > one ? one : b;
    const IntLanes at = yi * stride + xi;
    FloatLanes p0{};
    FloatLanes p1{};
    FloatLanes q0{};
    FloatLanes q1{};
    for (int l = 0; l < kLanes; ++l) {
      const float* p = picture + at[l];
      p0[l] = p[0];
      p1[l] = p[1];
      q0[l] = p[stride];
      q1[l] = p[stride + 1];
    }
    const FloatLanes upper = p0 + a * (p1 - p0);
    const FloatLanes lower = q0 + a * (q1 - q0);
    StoreLanes(upper + b * (lower - upper), values + k);
  }
}

}  // namespace

void SamplePatchInLanes(
    const cv::Mat& picture, double x, double y, int n, float* values, int stride) {
  float copy[kGatherSize];
  Interpolate(Gather(picture, x, y, n, RoundUpToLanes(n), copy), n, values, stride);
}

void SampleWarpedInLanes(const cv::Mat& picture,
                         const Eigen::Vector2d& center,
                         const Eigen::Matrix2d& warp,
                         int n,
                         float* values,
                         int stride) {
  const int half = n / 2;
  for (int v = -half; v <= half; ++v, values += stride) {
    InterpolateAlong(picture.ptr<float>(),
                     static_cast<int>(picture.step1()),
                     picture.cols - 2,
                     picture.rows - 2,
                     static_cast<float>(center.x() + warp(0, 1) * v),
                     static_cast<float>(center.y() + warp(1, 1) * v),
                     static_cast<float>(warp(0, 0)),
                     static_cast<float>(warp(1, 0)),
                     n,
                     values);
  }
}

void SamplePatch(const cv::Mat& picture, double x, double y, int n, float* values) {
  float lanes[kMaxPatchSide * RoundUpToLanes(kMaxPatchSide)];
  const int stride = RoundUpToLanes(n);
  SamplePatchInLanes(picture, x, y, n, lanes, stride);
  for (int r = 0; r < n; ++r) std::copy_n(lanes + r * stride, n, values + r * n);
}

void SamplePatchWithGradientInLanes(const cv::Mat& picture,
                                    double x,
                                    double y,
                                    int n,
                                    float* values,
                                    float* dx,
                                    float* dy,
                                    int stride) {
  float copy[kGatherSize];
  const Pixels pixels = Gather(picture, x, y, n, RoundUpToLanes(n), copy);
  InterpolateWithGradient(pixels, n, values, dx, dy, stride);
}

}  // namespace cohort
