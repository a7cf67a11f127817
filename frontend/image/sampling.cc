#include "frontend/image/sampling.h"

#include <algorithm>
#include <cmath>

namespace cohort {
namespace {

// The (n + 1) x (n + 1) pixels that a patch needs: in place where it lies inside the picture, else
// copied with the border repeated.
struct Pixels {
  const float* data;
  std::ptrdiff_t stride;
  float a;  // sub-pixel weights
  float b;
};

Pixels Gather(const cv::Mat& picture, double x, double y, int n, float* copy) {
  const double left = x - n / 2;
  const double top = y - n / 2;
  // Far outside, the position only has to stay representable.
  const int x0 = static_cast<int>(std::floor(std::clamp(left, -1e6, 1e6)));
  const int y0 = static_cast<int>(std::floor(std::clamp(top, -1e6, 1e6)));
  const auto a = static_cast<float>(std::clamp(left - x0, 0.0, 1.0));
  const auto b = static_cast<float>(std::clamp(top - y0, 0.0, 1.0));
  const auto stride = static_cast<std::ptrdiff_t>(picture.step1());
  if (x0 >= 0 && y0 >= 0 && x0 + n < picture.cols && y0 + n < picture.rows) {
    return {picture.ptr<float>(y0) + x0, stride, a, b};
  }
  for (int r = 0; r <= n; ++r) {
    const float* row = picture.ptr<float>(std::clamp(y0 + r, 0, picture.rows - 1));
    for (int c = 0; c <= n; ++c) {
      copy[r * (n + 1) + c] = row[std::clamp(x0 + c, 0, picture.cols - 1)];
    }
  }
  return {copy, n + 1, a, b};
}

constexpr int kGatherSize = (kMaxPatchSide + 1) * (kMaxPatchSide + 1);

// Compiled twice, the wider one chosen at run time. Without fused multiply-add, so that both give
// the same bytes.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__)
#define COHORT_SIMD_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define COHORT_SIMD_CLONES
#endif

COHORT_SIMD_CLONES void InterpolateRow(const float* __restrict p0,
                                       const float* __restrict p1,
                                       float a,
                                       float b,
                                       int n,
                                       float* __restrict values) {
  for (int c = 0; c < n; ++c) {
    const float upper = p0[c] + a * (p0[c + 1] - p0[c]);
    const float lower = p1[c] + a * (p1[c + 1] - p1[c]);
    values[c] = upper + b * (lower - upper);
  }
}

COHORT_SIMD_CLONES void InterpolateRowWithGradient(const float* __restrict p0,
                                                   const float* __restrict p1,
                                                   float a,
                                                   float b,
                                                   int n,
                                                   float* __restrict values,
                                                   float* __restrict dx,
                                                   float* __restrict dy) {
  for (int c = 0; c < n; ++c) {
    const float upper_step = p0[c + 1] - p0[c];
    const float lower_step = p1[c + 1] - p1[c];
    const float upper = p0[c] + a * upper_step;
    const float lower = p1[c] + a * lower_step;
    values[c] = upper + b * (lower - upper);
    dx[c] = upper_step + b * (lower_step - upper_step);
    dy[c] = lower - upper;
  }
}

}  // namespace

void SamplePatch(const cv::Mat& picture, double x, double y, int n, float* values) {
  float copy[kGatherSize];
  const Pixels pixels = Gather(picture, x, y, n, copy);
  for (int r = 0; r < n; ++r) {
    const float* row = pixels.data + r * pixels.stride;
    InterpolateRow(row, row + pixels.stride, pixels.a, pixels.b, n, values + r * n);
  }
}

void SamplePatchWithGradient(
    const cv::Mat& picture, double x, double y, int n, float* values, float* dx, float* dy) {
  float copy[kGatherSize];
  const Pixels pixels = Gather(picture, x, y, n, copy);
  for (int r = 0; r < n; ++r) {
    const float* row = pixels.data + r * pixels.stride;
    InterpolateRowWithGradient(
        row, row + pixels.stride, pixels.a, pixels.b, n, values + r * n, dx + r * n, dy + r * n);
  }
}

}  // namespace cohort
