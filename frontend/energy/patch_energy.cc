#include "frontend/energy/patch_energy.h"

#include <algorithm>
#include <cmath>

#include "frontend/core/error.h"
#include "frontend/image/lanes.h"
#include "frontend/image/sampling.h"

namespace cohort {
namespace {

constexpr int kMostStride = RoundUpToLanes(kMaxPatchSide);
constexpr int kMostFloats = kMaxPatchSide * kMostStride;

// The template in rows of whole lanes, and the picture at x with its derivatives if requested.
struct Patches {
  int n = 0;
  int stride = 0;
  alignas(32) float patch[kMostFloats];
  alignas(32) float values[kMostFloats];
  alignas(32) float dx[kMostFloats];
  alignas(32) float dy[kMostFloats];

  // cppcheck-suppress uninitMemberVar; Sample fills them, and initialising them would take time
  Patches(std::span<const float> rows, int side) : n(side), stride(RoundUpToLanes(side)) {
    Check(static_cast<int>(rows.size()) == n * n && n <= kMaxPatchSide, "patch is n x n");
    for (int r = 0; r < n; ++r) {
      std::copy_n(rows.data() + r * n, n, patch + r * stride);
      std::fill(patch + r * stride + n, patch + (r + 1) * stride, 0.0F);
    }
  }
  void Sample(const cv::Mat& picture, const Eigen::Vector2d& x) {
    SamplePatchInLanes(picture, x.x(), x.y(), n, values, stride);
  }
  void SampleWithGradient(const cv::Mat& picture, const Eigen::Vector2d& x) {
    SamplePatchWithGradientInLanes(picture, x.x(), x.y(), n, values, dx, dy, stride);
  }

  // Picture - template of eight pixels, 0 beyond the end of the row.
  COHORT_LANES_INLINE FloatLanes Residual(int at, const IntLanes& inside) const {
    return Masked(LoadLanes(values + at) - LoadLanes(patch + at), inside);
  }
};

COHORT_SIMD_CLONES double SumAbsolute(const Patches& p) {
  FloatLanes sum{};
  for (int r = 0; r < p.n; ++r) {
    for (int k = 0; k < p.n; k += kLanes) {
      sum += Absolute(p.Residual(r * p.stride + k, FirstLanes(p.n - k)));
    }
  }
  return SumOf(sum);
}

// |r|, sign(r) dx, sign(r) dy.
COHORT_SIMD_CLONES void SumGradient(const Patches& p, double* sums) {
  const FloatLanes zero{};
  FloatLanes sum{}, gx{}, gy{};
  for (int r = 0; r < p.n; ++r) {
    for (int k = 0; k < p.n; k += kLanes) {
      const int at = r * p.stride + k;
      const FloatLanes residual = p.Residual(at, FirstLanes(p.n - k));
      const FloatLanes dx = LoadLanes(p.dx + at);
      const FloatLanes dy = LoadLanes(p.dy + at);
      sum += Absolute(residual);
      gx += Masked(dx, residual > zero) - Masked(dx, residual < zero);
      gy += Masked(dy, residual > zero) - Masked(dy, residual < zero);
    }
  }
  sums[0] = SumOf(sum);
  sums[1] = SumOf(gx);
  sums[2] = SumOf(gy);
}

// |r|, w r dx, w r dy, w dx dx, w dx dy, w dy dy, w = 1 / max(|r|, floor).
COHORT_SIMD_CLONES void SumQuadratic(const Patches& p, float floor, double* sums) {
  const FloatLanes least = FloatLanes{} + floor;
  FloatLanes sum{}, gx{}, gy{}, hxx{}, hxy{}, hyy{};
  for (int r = 0; r < p.n; ++r) {
    for (int k = 0; k < p.n; k += kLanes) {
      const int at = r * p.stride + k;
      const IntLanes inside = FirstLanes(p.n - k);
      const FloatLanes residual = p.Residual(at, inside);
      const FloatLanes size = Absolute(residual);
      const FloatLanes w = 1.0F / (size > least ? size : least);
      const FloatLanes dx = Masked(LoadLanes(p.dx + at), inside);
      const FloatLanes dy = Masked(LoadLanes(p.dy + at), inside);
      const FloatLanes wx = w * dx;
      const FloatLanes wy = w * dy;
      sum += size;
      gx += wx * residual;
      gy += wy * residual;
      hxx += wx * dx;
      hxy += wx * dy;
      hyy += wy * dy;
    }
  }
  sums[0] = SumOf(sum);
  sums[1] = SumOf(gx);
  sums[2] = SumOf(gy);
  sums[3] = SumOf(hxx);
  sums[4] = SumOf(hxy);
  sums[5] = SumOf(hyy);
}

}  // namespace

double PatchEnergy(const cv::Mat& picture,
                   const Eigen::Vector2d& x,
                   std::span<const float> patch,
                   int n) {
  Patches patches(patch, n);
  patches.Sample(picture, x);
  return SumAbsolute(patches) / (n * n);
}

PatchGradient PatchEnergyGradient(const cv::Mat& picture,
                                  const Eigen::Vector2d& x,
                                  std::span<const float> patch,
                                  int n) {
  Patches patches(patch, n);
  patches.SampleWithGradient(picture, x);
  double sums[3];
  SumGradient(patches, sums);
  return {sums[0] / (n * n), Eigen::Vector2d(sums[1], sums[2]) / (n * n)};
}

PatchQuadratic PatchEnergyQuadratic(const cv::Mat& picture,
                                    const Eigen::Vector2d& x,
                                    std::span<const float> patch,
                                    int n,
                                    double floor) {
  Patches patches(patch, n);
  patches.SampleWithGradient(picture, x);
  double sums[6];
  SumQuadratic(patches, static_cast<float>(floor), sums);
  PatchQuadratic q;
  q.energy = sums[0] / (n * n);
  q.gradient = Eigen::Vector2d(sums[1], sums[2]) / (n * n);
  q.hessian << sums[3], sums[4], sums[4], sums[5];
  q.hessian /= n * n;
  return q;
}

}  // namespace cohort
