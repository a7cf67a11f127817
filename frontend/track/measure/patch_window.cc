#include "frontend/track/measure/patch_window.h"

namespace cohort {
namespace {

// The window's values and one pixel around them, and what lanes read behind them.
struct Bordered {
  static constexpr int kMostStride = RoundUpToLanes(kMaxPatchSide) + kLanes;

  int stride = 0;
  alignas(32) float values[(kMaxPatchSide + 2) * kMostStride];

  // Row r of the window, the row before and the row behind.
  struct Rows {
    const float* before;
    const float* here;
    const float* behind;
  };
  Rows Around(int r) const {
    const float* before = values + r * stride;
    return {before, before + stride, before + 2 * stride};
  }
};

// The lanes of a row that are its last ones reach RoundUpToLanes(n) + 2, those sampled
// RoundUpToLanes(n + 2).
int BorderedStride(int n) { return RoundUpToLanes(n) + kLanes; }

struct Gradient {
  FloatLanes dx;
  FloatLanes dy;
};

// Of eight pixels, from column k on.
COHORT_LANES_INLINE Gradient ScharrOf(const Bordered::Rows& rows, int k) {
  const auto [a, b, c] = rows;
  const FloatLanes a0 = LoadLanes(a + k);
  const FloatLanes a2 = LoadLanes(a + k + 2);
  const FloatLanes c0 = LoadLanes(c + k);
  const FloatLanes c2 = LoadLanes(c + k + 2);
  const FloatLanes rising = c2 - a0;
  const FloatLanes falling = a2 - c0;
  return {
      (3.0F * (rising + falling) + 10.0F * (LoadLanes(b + k + 2) - LoadLanes(b + k))) / 32.0F,
      (3.0F * (rising - falling) + 10.0F * (LoadLanes(c + k + 1) - LoadLanes(a + k + 1))) / 32.0F};
}

// From `bordered`; the means are not removed yet but in `sums`: of dx, dy and the values.
COHORT_SIMD_CLONES void FillFrom(const Bordered& bordered, PatchWindow& window, double* sums) {
  const int n = window.n;
  FloatLanes sum_x{};
  FloatLanes sum_y{};
  FloatLanes sum{};
  for (int r = 0; r < n; ++r) {
    const Bordered::Rows rows = bordered.Around(r);
    for (int k = 0; k < n; k += kLanes) {
      const IntLanes inside = FirstLanes(n - k);
      const Gradient g = ScharrOf(rows, k);
      const FloatLanes dx = Masked(g.dx, inside);
      const FloatLanes dy = Masked(g.dy, inside);
      const FloatLanes value = Masked(LoadLanes(rows.here + k + 1), inside);
      const int at = r * window.stride + k;
      StoreLanes(dx, window.dx + at);
      StoreLanes(dy, window.dy + at);
      StoreLanes(value, window.values + at);
      sum_x += dx;
      sum_y += dy;
      sum += value;
    }
  }
  sums[0] = SumOf(sum_x);
  sums[1] = SumOf(sum_y);
  sums[2] = SumOf(sum);
}

COHORT_SIMD_CLONES void Subtract(float mean_x, float mean_y, PatchWindow& window) {
  for (int r = 0; r < window.n; ++r) {
    for (int k = 0; k < window.n; k += kLanes) {
      const IntLanes inside = FirstLanes(window.n - k);
      const int at = r * window.stride + k;
      StoreLanes(Masked(LoadLanes(window.dx + at) - mean_x, inside), window.dx + at);
      StoreLanes(Masked(LoadLanes(window.dy + at) - mean_y, inside), window.dy + at);
    }
  }
}

void Fill(const Bordered& bordered, int n, PatchWindow& window) {
  window.n = n;
  window.stride = RoundUpToLanes(n);
  double sums[3];
  FillFrom(bordered, window, sums);
  const double area = n * n;
  window.mean = sums[2] / area;
  Subtract(static_cast<float>(sums[0] / area), static_cast<float>(sums[1] / area), window);
}

// Sums over a window, in this order: dx, dy of the picture, r, r gx, r gy, gx gx, gx gy, gy gy, and
// the windows' gradients with each other: xx, xy, yy. g is the sum of both windows' gradients, of
// which the picture's still has its mean.
constexpr int kTranslationSums = 11;
COHORT_SIMD_CLONES void SumTranslation(const Bordered& bordered,
                                       const PatchWindow& window,
                                       double* sums) {
  const int n = window.n;
  FloatLanes sum_x{}, sum_y{}, sum_r{}, sum_rx{}, sum_ry{}, sum_xx{}, sum_xy{}, sum_yy{};
  FloatLanes cross_xx{}, cross_xy{}, cross_yy{};
  for (int r = 0; r < n; ++r) {
    const Bordered::Rows rows = bordered.Around(r);
    for (int k = 0; k < n; k += kLanes) {
      const IntLanes inside = FirstLanes(n - k);
      const int at = r * window.stride + k;
      const Gradient g = ScharrOf(rows, k);
      const FloatLanes dx = Masked(g.dx, inside);
      const FloatLanes dy = Masked(g.dy, inside);
      const FloatLanes residual =
          Masked(LoadLanes(rows.here + k + 1), inside) - LoadLanes(window.values + at);
      const FloatLanes wx = LoadLanes(window.dx + at);
      const FloatLanes wy = LoadLanes(window.dy + at);
      const FloatLanes gx = dx + wx;
      const FloatLanes gy = dy + wy;
      sum_x += dx;
      sum_y += dy;
      sum_r += residual;
      sum_rx += residual * gx;
      sum_ry += residual * gy;
      sum_xx += gx * gx;
      sum_xy += gx * gy;
      sum_yy += gy * gy;
      cross_xx += dx * wx;
      cross_xy += dx * wy + dy * wx;
      cross_yy += dy * wy;
    }
  }
  sums[0] = SumOf(sum_x);
  sums[1] = SumOf(sum_y);
  sums[2] = SumOf(sum_r);
  sums[3] = SumOf(sum_rx);
  sums[4] = SumOf(sum_ry);
  sums[5] = SumOf(sum_xx);
  sums[6] = SumOf(sum_xy);
  sums[7] = SumOf(sum_yy);
  sums[8] = SumOf(cross_xx);
  sums[9] = 0.5 * SumOf(cross_xy);
  sums[10] = SumOf(cross_yy);
}

// Sums over a window with u = (u, v) the offset from its centre: of the products gx gx, gx gy,
// gy gy times 1, u, v, u u, u v, v v; of gx, gy, r gx, r gy times 1, u, v; of r; of the windows'
// gradients with each other.
enum : int {
  kXX = 0,
  kXY = 6,
  kYY = 12,
  kGx = 18,
  kGy = 21,
  kRx = 24,
  kRy = 27,
  kR = 30,
  kCrossXX = 31,
  kCrossXY = 32,
  kCrossYY = 33,
  kWarpSums = 34
};

// A row's sums times 1, u and u u, into those of the window.
COHORT_LANES_INLINE void AddQuadratic(FloatLanes* sums, const FloatLanes* row, float v) {
  sums[0] += row[0];
  sums[1] += row[1];
  sums[2] += v * row[0];
  sums[3] += row[2];
  sums[4] += v * row[1];
  sums[5] += v * v * row[0];
}

COHORT_LANES_INLINE void AddLinear(FloatLanes* sums, const FloatLanes* row, float v) {
  sums[0] += row[0];
  sums[1] += row[1];
  sums[2] += v * row[0];
}

COHORT_SIMD_CLONES void SumWarp(const PatchWindow& seen, const PatchWindow& window, double* sums) {
  const int n = window.n;
  const int half = n / 2;
  FloatLanes all[kWarpSums] = {};
  for (int r = 0; r < n; ++r) {
    FloatLanes xx[3] = {}, xy[3] = {}, yy[3] = {}, gx1[2] = {}, gy1[2] = {}, rx[2] = {}, ry[2] = {};
    for (int k = 0; k < n; k += kLanes) {
      const int at = r * window.stride + k;
      const FloatLanes u = LaneNumbers() + static_cast<float>(k - half);
      const FloatLanes wx = LoadLanes(window.dx + at);
      const FloatLanes wy = LoadLanes(window.dy + at);
      const FloatLanes sx = LoadLanes(seen.dx + at);
      const FloatLanes sy = LoadLanes(seen.dy + at);
      const FloatLanes residual = LoadLanes(seen.values + at) - LoadLanes(window.values + at);
      const FloatLanes gx = 0.5F * (wx + sx);
      const FloatLanes gy = 0.5F * (wy + sy);
      const FloatLanes gxu = gx * u;
      const FloatLanes gyu = gy * u;
      xx[0] += gx * gx;
      xx[1] += gx * gxu;
      xx[2] += gxu * gxu;
      xy[0] += gx * gy;
      xy[1] += gx * gyu;
      xy[2] += gxu * gyu;
      yy[0] += gy * gy;
      yy[1] += gy * gyu;
      yy[2] += gyu * gyu;
      gx1[0] += gx;
      gx1[1] += gxu;
      gy1[0] += gy;
      gy1[1] += gyu;
      rx[0] += residual * gx;
      rx[1] += residual * gxu;
      ry[0] += residual * gy;
      ry[1] += residual * gyu;
      all[kR] += residual;
      all[kCrossXX] += wx * sx;
      all[kCrossXY] += 0.5F * (wx * sy + wy * sx);
      all[kCrossYY] += wy * sy;
    }
    const auto v = static_cast<float>(r - half);
    AddQuadratic(all + kXX, xx, v);
    AddQuadratic(all + kXY, xy, v);
    AddQuadratic(all + kYY, yy, v);
    AddLinear(all + kGx, gx1, v);
    AddLinear(all + kGy, gy1, v);
    AddLinear(all + kRx, rx, v);
    AddLinear(all + kRy, ry, v);
  }
  for (int i = 0; i < kWarpSums; ++i) sums[i] = SumOf(all[i]);
}

COHORT_SIMD_CLONES void SumProducts(const PatchWindow& seen,
                                    const PatchWindow& window,
                                    WindowComparison& sums) {
  const int n = window.n;
  const auto seen_mean = static_cast<float>(seen.mean);
  const auto mean = static_cast<float>(window.mean);
  FloatLanes squares{}, window_squares{}, products{}, absolute{};
  for (int r = 0; r < n; ++r) {
    for (int k = 0; k < n; k += kLanes) {
      const IntLanes inside = FirstLanes(n - k);
      const int at = r * window.stride + k;
      const FloatLanes s = LoadLanes(seen.values + at);
      const FloatLanes w = LoadLanes(window.values + at);
      const FloatLanes s0 = Masked(s - seen_mean, inside);
      const FloatLanes w0 = Masked(w - mean, inside);
      squares += s0 * s0;
      window_squares += w0 * w0;
      products += s0 * w0;
      absolute += Absolute(s - w);
    }
  }
  sums = {SumOf(squares), SumOf(window_squares), SumOf(products), SumOf(absolute)};
}

}  // namespace

void FillWindow(const cv::Mat& picture, const Eigen::Vector2d& x, int n, PatchWindow& window) {
  Bordered bordered;
  bordered.stride = BorderedStride(n);
  SamplePatchInLanes(picture, x.x(), x.y(), n + 2, bordered.values, bordered.stride);
  Fill(bordered, n, window);
}

void FillWarpedWindow(const cv::Mat& picture,
                      const Eigen::Vector2d& center,
                      const Eigen::Matrix2d& warp,
                      int n,
                      PatchWindow& window) {
  Bordered bordered;
  bordered.stride = BorderedStride(n);
  SampleWarpedInLanes(picture, center, warp, n + 2, bordered.values, bordered.stride);
  Fill(bordered, n, window);
}

TranslationEquations LinearizeTranslation(const cv::Mat& picture,
                                          const Eigen::Vector2d& x,
                                          const PatchWindow& window) {
  Bordered bordered;
  bordered.stride = BorderedStride(window.n);
  SamplePatchInLanes(picture, x.x(), x.y(), window.n + 2, bordered.values, bordered.stride);
  double s[kTranslationSums];
  SumTranslation(bordered, window, s);
  // g = (both windows' gradients - the picture's mean) / 2; the window's has none.
  const double area = window.n * window.n;
  const Eigen::Vector2d sum(s[0], s[1]);
  Eigen::Matrix2d products;
  products << s[5], s[6], s[6], s[7];
  Eigen::Matrix2d cross;
  cross << s[8], s[9], s[9], s[10];
  return {0.25 * (products - sum * sum.transpose() / area),
          0.5 * (Eigen::Vector2d(s[3], s[4]) - sum * (s[2] / area)),
          cross};
}

WarpEquations LinearizeWarp(const PatchWindow& seen, const PatchWindow& window) {
  double s[kWarpSums];
  SumWarp(seen, window, s);
  // Of gx, gy times 1, u, v with the same: columns and rows gx, gy, gx u, gx v, gy u, gy v, 1.
  WarpEquations e;
  auto& m = e.normal;
  const double* xx = s + kXX;
  const double* xy = s + kXY;
  const double* yy = s + kYY;
  m.row(0) << xx[0], xy[0], xx[1], xx[2], xy[1], xy[2], s[kGx];
  m.row(1) << xy[0], yy[0], xy[1], xy[2], yy[1], yy[2], s[kGy];
  m.row(2) << xx[1], xy[1], xx[3], xx[4], xy[3], xy[4], s[kGx + 1];
  m.row(3) << xx[2], xy[2], xx[4], xx[5], xy[4], xy[5], s[kGx + 2];
  m.row(4) << xy[1], yy[1], xy[3], xy[4], yy[3], yy[4], s[kGy + 1];
  m.row(5) << xy[2], yy[2], xy[4], xy[5], yy[4], yy[5], s[kGy + 2];
  m.row(6) << s[kGx], s[kGy], s[kGx + 1], s[kGx + 2], s[kGy + 1], s[kGy + 2], window.n * window.n;
  e.rhs << s[kRx], s[kRy], s[kRx + 1], s[kRx + 2], s[kRy + 1], s[kRy + 2], s[kR];
  e.rhs = -e.rhs;
  e.cross << s[kCrossXX], s[kCrossXY], s[kCrossXY], s[kCrossYY];
  return e;
}

WindowComparison CompareWindows(const PatchWindow& seen, const PatchWindow& window) {
  WindowComparison sums;
  SumProducts(seen, window, sums);
  return sums;
}

}  // namespace cohort
