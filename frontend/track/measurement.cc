#include "frontend/track/measurement.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "frontend/core/error.h"
#include "frontend/image/sampling.h"

namespace cohort {
namespace {

int MarginOf(int window_px) { return std::min(window_px / 2, (kMaxPatchSide - window_px) / 2); }

// Bilinear samples at x + A u, for u of an n x n window. Outside the picture its border repeats.
void SampleAffine(
    const cv::Mat& picture, const Eigen::Vector2d& x, const Eigen::Matrix2d& A, int n, float* out) {
  const int half = n / 2;
  const int last_x = picture.cols - 2;
  const int last_y = picture.rows - 2;
  const auto axx = static_cast<float>(A(0, 0));
  const auto ayx = static_cast<float>(A(1, 0));
  for (int v = -half; v <= half; ++v) {
    const auto x0 = static_cast<float>(x.x() + A(0, 1) * v);
    const auto y0 = static_cast<float>(x.y() + A(1, 1) * v);
    for (int u = -half; u <= half; ++u) {
      const float xu = x0 + axx * static_cast<float>(u);
      const float yu = y0 + ayx * static_cast<float>(u);
      const int xi = std::clamp(static_cast<int>(xu), 0, last_x);
      const int yi = std::clamp(static_cast<int>(yu), 0, last_y);
      const float a = std::clamp(xu - static_cast<float>(xi), 0.0F, 1.0F);
      const float b = std::clamp(yu - static_cast<float>(yi), 0.0F, 1.0F);
      const float* p = picture.ptr<float>(yi) + xi;
      const float* q = picture.ptr<float>(yi + 1) + xi;
      const float top = p[0] + a * (p[1] - p[0]);
      *out++ = top + b * (q[0] + a * (q[1] - q[0]) - top);
    }
  }
}

cv::Mat CopyPatch(const cv::Mat& picture,
                  const Eigen::Vector2d& xy,
                  const Eigen::Matrix2d& warp,
                  int side) {
  cv::Mat patch(side, side, CV_32FC1);
  if (warp.isIdentity()) {
    SamplePatch(picture, xy.x(), xy.y(), side, patch.ptr<float>());
  } else {
    SampleAffine(picture, xy, warp, side, patch.ptr<float>());
  }
  return patch;
}

// The window as it should look now: T(warp^-1 u).
void WarpAnchor(const cv::Mat& wide,
                const Eigen::Matrix2d& picture_from_anchor,
                int n,
                float* out) {
  const double center = wide.cols / 2;
  SampleAffine(wide, {center, center}, picture_from_anchor.inverse(), n, out);
}

// Values and gradient [1/px] of an n x n window. The gradient is Scharr's, not that of the bilinear
// interpolant: the latter also sees how interpolation blurs differently at every sub-pixel phase,
// which pulls the minimum by tenths of a pixel. Its mean is removed: a constant difference of
// brightness then has no say.
struct Window {
  float values[kMaxPatchArea];
  float dx[kMaxPatchArea];
  float dy[kMaxPatchArea];
};

constexpr int kBorderedArea = (kMaxPatchSide + 2) * (kMaxPatchSide + 2);

// `bordered`: (n + 2) x (n + 2) values.
void FillWindow(const float* bordered, int n, Window& window) {
  const int m = n + 2;
  float sum_x = 0.0F;
  float sum_y = 0.0F;
  for (int r = 0; r < n; ++r) {
    const float* a = bordered + r * m;
    const float* b = a + m;
    const float* c = b + m;
    float* values = window.values + r * n;
    float* dx = window.dx + r * n;
    float* dy = window.dy + r * n;
    for (int k = 0; k < n; ++k) {
      values[k] = b[k + 1];
      dx[k] = (3.0F * (a[k + 2] - a[k] + c[k + 2] - c[k]) + 10.0F * (b[k + 2] - b[k])) / 32.0F;
      dy[k] = (3.0F * (c[k] - a[k] + c[k + 2] - a[k + 2]) + 10.0F * (c[k + 1] - a[k + 1])) / 32.0F;
      sum_x += dx[k];
      sum_y += dy[k];
    }
  }
  const int area = n * n;
  const float mean_x = sum_x / static_cast<float>(area);
  const float mean_y = sum_y / static_cast<float>(area);
  for (int i = 0; i < area; ++i) {
    window.dx[i] -= mean_x;
    window.dy[i] -= mean_y;
  }
}

// The anchor as it should look now.
void AnchorWindow(const cv::Mat& wide, const Eigen::Matrix2d& warp, int n, Window& window) {
  float bordered[kBorderedArea];
  WarpAnchor(wide, warp, n + 2, bordered);
  FillWindow(bordered, n, window);
}

void SampleWindow(const cv::Mat& picture, const Eigen::Vector2d& x, int n, Window& window) {
  float bordered[kBorderedArea];
  SamplePatch(picture, x.x(), x.y(), n + 2, bordered);
  FillWindow(bordered, n, window);
}

// Gauss-Newton for the translation on one level with the mean gradient of anchor and picture
// (efficient second-order minimisation); `x` in px of the level. None where the window has no
// texture.
std::optional<Eigen::Vector2d> Align(const cv::Mat& picture,
                                     const Window& window,
                                     int n,
                                     int max_iterations,
                                     const Eigen::Matrix2d& prior,
                                     Eigen::Vector2d x) {
  const Eigen::Vector2d start = x;
  const int area = n * n;
  Window seen;
  for (int i = 0; i < max_iterations; ++i) {
    SampleWindow(picture, x, n, seen);
    float bx = 0, by = 0, hxx = 0, hxy = 0, hyy = 0;
    for (int k = 0; k < area; ++k) {
      const float r = seen.values[k] - window.values[k];
      const float gx = 0.5F * (seen.dx[k] + window.dx[k]);
      const float gy = 0.5F * (seen.dy[k] + window.dy[k]);
      bx += r * gx;
      by += r * gy;
      hxx += gx * gx;
      hxy += gx * gy;
      hyy += gy * gy;
    }
    Eigen::Matrix2d H;
    H << hxx, hxy, hxy, hyy;
    H += prior;
    if (!(H.determinant() > 1e-12)) return std::nullopt;
    Eigen::Vector2d step = -H.inverse() * (Eigen::Vector2d(bx, by) + prior * (x - start));
    const double length = step.norm();
    if (!std::isfinite(length)) return std::nullopt;
    if (length > 2.0) step *= 2.0 / length;
    x += step;
    if (length < 0.01) break;  // if it never is: slow is not wrong, the tests on the result decide
  }
  return x;
}

// Noise has gradients too. They make a patch look sharper than it is, and add to the noise: with H
// the moments of the gradients seen and T those of the true ones (of anchor times picture, whose
// noises know nothing of each other), the variance is not 1 / H but T^-1 H T^-1.
Eigen::Matrix2d Sandwich(const Eigen::Matrix2d& shape,
                         const Eigen::Matrix2d& seen,
                         const Eigen::Matrix2d& cross) {
  constexpr double kLeastShare = 0.05;
  const Eigen::LLT<Eigen::Matrix2d> root(seen);
  if (root.info() != Eigen::Success) return shape;
  // Eigenvalues of the true share of each direction.
  const Eigen::Matrix2d L = root.matrixL();
  const Eigen::Matrix2d L_inverse = L.inverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(L_inverse * cross *
                                                             L_inverse.transpose());
  const Eigen::Matrix2d share =
      eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(kLeastShare).cwiseInverse().asDiagonal() *
      eigen.eigenvectors().transpose();
  const Eigen::Matrix2d T = L_inverse.transpose() * share * L.transpose();  // T^-1 H
  return T * shape * T.transpose();
}

// How anchor and picture at m.xy look alike.
void CompareWindows(const Window& seen, const Window& window, int n, Measurement& m) {
  const int area = n * n;
  double sv = 0, st = 0, svv = 0, stt = 0, svt = 0, sabs = 0;
  for (int k = 0; k < area; ++k) {
    const double v = seen.values[k];
    const double t = window.values[k];
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
  m.correlation = cvv > 0.0 && ctt > 0.0 ? cvt / std::sqrt(cvv * ctt) : 0.0;
  m.residual_variance = std::max(0.0, (cvv + ctt - 2.0 * cvt) / area);
  m.residual = sabs / area;
}

using Matrix7d = Eigen::Matrix<double, 7, 7>;
using Vector7d = Eigen::Matrix<double, 7, 1>;
using Matrix7f = Eigen::Matrix<float, 7, 7>;
using Vector7f = Eigen::Matrix<float, 7, 1>;

// Least squares for a step of translation s, relative warp D = (d11 d12; d21 d22) and mean
// together: r(u) + g.s + g.(D u) - mean = 0. The gradient g is the mean of both windows': with that
// of one alone its noise, multiplied with the same noise in r, would read as a change of scale.
struct NormalEquations {
  Matrix7f normal = Matrix7f::Zero();
  Vector7f rhs = Vector7f::Zero();
  Eigen::Matrix2d cross;  // moments of the windows' gradients with each other
};

NormalEquations Linearize(const Window& seen, const Window& window, int n) {
  NormalEquations equations;
  float cross_xx = 0, cross_xy = 0, cross_yy = 0;
  const int half = n / 2;
  int k = 0;
  for (int v = -half; v <= half; ++v) {
    for (int u = -half; u <= half; ++u, ++k) {
      const auto uf = static_cast<float>(u);
      const auto vf = static_cast<float>(v);
      Vector7f j;
      const float gx = 0.5F * (window.dx[k] + seen.dx[k]);
      const float gy = 0.5F * (window.dy[k] + seen.dy[k]);
      j << gx, gy, gx * uf, gx * vf, gy * uf, gy * vf, 1.0F;
      cross_xx += window.dx[k] * seen.dx[k];
      cross_xy += 0.5F * (window.dx[k] * seen.dy[k] + window.dy[k] * seen.dx[k]);
      cross_yy += window.dy[k] * seen.dy[k];
      const float r = seen.values[k] - window.values[k];
      equations.normal.noalias() += j * j.transpose();
      equations.rhs.noalias() -= r * j;
    }
  }
  equations.cross << cross_xx, cross_xy, cross_xy, cross_yy;
  return equations;
}

// Takes the step, if it is a small one: translation and warp are then those of the minimum.
void Step(const Vector7d& step,
          const Matrix7d& covariance,
          const AnchorPatch& anchor,
          Measurement& m) {
  m.warp = anchor.warp;
  m.warp_covariance = anchor.warp_covariance;
  if (!step.allFinite() || step.head<2>().norm() > 1.0 || step.segment<4>(2).norm() > 0.2) return;
  m.xy += step.head<2>();
  Eigen::Matrix2d D;
  D << step[2], step[3], step[4], step[5];
  m.warp = (Eigen::Matrix2d::Identity() + D) * anchor.warp;
  m.warp_covariance = covariance.block<4, 4>(2, 2);
}

// Anchor against picture at m.xy: the statistics, and the joint step of translation and warp.
void Conclude(const cv::Mat& picture,
              const Window& window,
              int n,
              double noise_factor,
              const AnchorPatch& anchor,
              const Eigen::Vector2d& start,
              const Eigen::Matrix2d& prior,
              Measurement& m) {
  const int area = n * n;
  Window seen;
  SampleWindow(picture, m.xy, n, seen);
  CompareWindows(seen, window, n, m);
  const auto [normal, rhs, cross] = Linearize(seen, window, n);

  const double variance = std::max(m.residual_variance, 1e-6) * noise_factor;
  Matrix7d information = normal.cast<double>() / variance;
  Vector7d b = rhs.cast<double>() / variance;
  information.block<4, 4>(2, 2) +=
      (anchor.warp_covariance + 1e-10 * Eigen::Matrix4d::Identity()).inverse();
  const Matrix7d likelihood = information.ldlt().solve(Matrix7d::Identity());
  m.gradients =
      (anchor.gradients_count * anchor.gradients + cross / area) / (anchor.gradients_count + 1.0);
  m.shape = Sandwich(likelihood.topLeftCorner<2, 2>() / noise_factor,
                     normal.topLeftCorner<2, 2>().cast<double>() / area,
                     m.gradients);
  Matrix7d covariance = likelihood;
  if (prior.trace() > 0.0) {
    information.topLeftCorner<2, 2>() += prior;
    b.head<2>() += prior * (start - m.xy);
    covariance = information.ldlt().solve(Matrix7d::Identity());
  }
  Step(covariance * b, covariance, anchor, m);
}

}  // namespace

AnchorPatch TakeAnchor(const Pyramid& pyramid,
                       const Eigen::Vector2d& xy,
                       int window_px,
                       int largest_px,
                       const Eigen::Matrix2d& warp) {
  const int side = largest_px + 2 * MarginOf(largest_px);
  AnchorPatch anchor;
  anchor.full = CopyPatch(pyramid.levels[0], xy, warp, side);
  if (pyramid.levels.size() > 1) anchor.half = CopyPatch(pyramid.levels[1], xy / 2, warp, side);
  float window[kMaxPatchArea];
  WarpAnchor(anchor.full, anchor.warp, window_px, window);
  const int area = window_px * window_px;
  double sum = 0.0;
  double square = 0.0;
  for (int k = 0; k < area; ++k) {
    sum += window[k];
    square += static_cast<double>(window[k]) * window[k];
  }
  anchor.signal_variance = std::max(0.0, square / area - sum * sum / area / area);
  Window with_gradient;
  AnchorWindow(anchor.full, anchor.warp, window_px, with_gradient);
  double gradient = 0.0;
  for (int k = 0; k < area; ++k) {
    gradient +=
        with_gradient.dx[k] * with_gradient.dx[k] + with_gradient.dy[k] * with_gradient.dy[k];
  }
  anchor.mean_square_gradient = gradient / (2.0 * area);
  return anchor;
}

Measurement MeasurePatch(const Pyramid& current,
                         const AnchorPatch& anchor,
                         const Eigen::Vector2d& start,
                         int window_px,
                         double noise_factor,
                         double noise_variance,
                         const Eigen::Matrix2d& prior) {
  Check(window_px <= kMaxPatchSide, "the window fits the patch buffers");
  const bool with_prior = prior.trace() > 0.0;
  Measurement m;
  m.xy = start;
  m.window_px = window_px;
  Window window;
  if (!with_prior && !anchor.half.empty()) {
    AnchorWindow(anchor.half, anchor.warp, window_px, window);
    const auto half = Align(current.levels[1], window, window_px, 10, prior, start / 2);
    // Where the half resolution leads astray, the full one starts from the start.
    if (half && (2 * *half - start).norm() < 6.0) m.xy = 2 * *half;
  }
  AnchorWindow(anchor.full, anchor.warp, window_px, window);
  const double variance = noise_variance * noise_factor;
  const auto full = Align(current.levels[0], window, window_px, 15, variance * prior, m.xy);
  if (!full) return m;
  m.xy = *full;
  m.converged = true;
  Conclude(current.levels[0], window, window_px, noise_factor, anchor, start, prior, m);
  return m;
}

CenterDifference CompareCenter(const Pyramid& current,
                               const AnchorPatch& anchor,
                               const Eigen::Vector2d& xy) {
  constexpr int kSide = 9;
  constexpr int kArea = kSide * kSide;
  float then[kArea];
  float now[kArea];
  WarpAnchor(anchor.full, anchor.warp, kSide, then);
  SamplePatch(current.levels[0], xy.x(), xy.y(), kSide, now);
  double sum = 0.0;
  double square = 0.0;
  for (int k = 0; k < kArea; ++k) {
    const double difference = now[k] - then[k];
    sum += difference;
    square += difference * difference;
  }
  const double mean = sum / kArea;
  return {mean, std::max(0.0, square / kArea - mean * mean)};
}

}  // namespace cohort
