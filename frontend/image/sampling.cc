#include "frontend/image/sampling.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "frontend/image/lanes.h"

namespace cohort {
namespace {

// The (n + 1) x (columns + 1) pixels that a patch needs: in place if they lie inside the picture,
// else copied with the border repeated.
struct Pixels {
  const float* data;
  std::ptrdiff_t stride;
  float a;  // sub-pixel weights
  float b;
};

Pixels Gather(const cv::Mat& picture, double x, double y, int n, int columns, float* copy) {
  const int half = n / 2;
  const double left = x - half;
  const double top = y - half;
  // Far outside the picture, the position only has to remain representable.
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

// The position of a warped window in a picture.
struct WarpedGrid {
  const float* picture;
  int stride;
  float last_x;  // column and row of the last pixel that has a right and a lower neighbour
  float last_y;
  float step_x;  // along a row of the window
  float step_y;
};

// Eight pixels and their right neighbours; two are loaded at a time.
struct AdjacentPixels {
  FloatLanes left;
  FloatLanes right;
};
COHORT_LANES_INLINE AdjacentPixels LoadPairs(const float* picture, const int* at) {
  using Pairs = double __attribute__((vector_size(4 * kLanes)));
  double pair[kLanes];
  for (int l = 0; l < kLanes; ++l) std::memcpy(pair + l, picture + at[l], sizeof(double));
  const Pairs first{pair[0], pair[1], pair[2], pair[3]};
  const Pairs second{pair[4], pair[5], pair[6], pair[7]};
  FloatLanes a;
  FloatLanes b;
  std::memcpy(&a, &first, sizeof(a));
  std::memcpy(&b, &second, sizeof(b));
  return {__builtin_shufflevector(a, b, 0, 2, 4, 6, 8, 10, 12, 14),
          __builtin_shufflevector(a, b, 1, 3, 5, 7, 9, 11, 13, 15)};
}

// A row of a warped window whose middle is at (x0, y0).
COHORT_SIMD_CLONES void InterpolateAlong(
    const WarpedGrid& grid, float x0, float y0, int n, float* values) {
  const int half = n / 2;
  const FloatLanes zero{};
  const FloatLanes one = zero + 1.0F;
  const FloatLanes last_x = zero + grid.last_x;
  const FloatLanes last_y = zero + grid.last_y;
  for (int k = 0; k < n; k += kLanes) {
    const FloatLanes u = LaneNumbers() + static_cast<float>(k - half);
    const FloatLanes x = x0 + grid.step_x * u;
    const FloatLanes y = y0 + grid.step_y * u;
    // The upper left pixel, clamped to those that have right and lower neighbours.
    FloatLanes left = x > zero ? x : zero;
    FloatLanes top = y > zero ? y : zero;
    left = left < last_x ? left : last_x;
    top = top < last_y ? top : last_y;
    const IntLanes column = __builtin_convertvector(left, IntLanes);
    const IntLanes row = __builtin_convertvector(top, IntLanes);
    FloatLanes a = x - __builtin_convertvector(column, FloatLanes);
    FloatLanes b = y - __builtin_convertvector(row, FloatLanes);
    a = a < zero ? zero : a;
    b = b < zero ? zero : b;
    a = a > one ? one : a;
    b = b > one ? one : b;
    const IntLanes index = row * grid.stride + column;
    int at[kLanes];
    std::memcpy(at, &index, sizeof(at));
    const AdjacentPixels p = LoadPairs(grid.picture, at);
    const AdjacentPixels q = LoadPairs(grid.picture + grid.stride, at);
    const FloatLanes upper = p.left + a * (p.right - p.left);
    const FloatLanes lower = q.left + a * (q.right - q.left);
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
  const WarpedGrid grid{picture.ptr<float>(),
                        static_cast<int>(picture.step1()),
                        static_cast<float>(picture.cols - 2),
                        static_cast<float>(picture.rows - 2),
                        static_cast<float>(warp(0, 0)),
                        static_cast<float>(warp(1, 0))};
  for (int v = -half; v <= half; ++v, values += stride) {
    InterpolateAlong(grid,
                     static_cast<float>(center.x() + warp(0, 1) * v),
                     static_cast<float>(center.y() + warp(1, 1) * v),
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
