#include "frontend/track/measurement.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

#include "frontend/core/error.h"
#include "frontend/image/sampling.h"
#include "frontend/track/patch_window.h"

namespace cohort {
namespace {

int MarginOf(int window_px) { return std::min(window_px / 2, (kMaxPatchSide - window_px) / 2); }

cv::Mat CopyPatch(const cv::Mat& picture,
                  const Eigen::Vector2d& xy,
                  const Eigen::Matrix2d& warp,
                  int side) {
  if (!warp.isIdentity()) {
    cv::Mat patch(side, RoundUpToLanes(side), CV_32FC1);
    SampleWarpedInLanes(picture, xy, warp, side, patch.ptr<float>(), patch.cols);
    return patch.colRange(0, side).clone();
  }
  cv::Mat patch(side, side, CV_32FC1);
  SamplePatch(picture, xy.x(), xy.y(), side, patch.ptr<float>());
  return patch;
}

// The anchor as it should look now: T(warp^-1 u).
void FillAnchorWindow(const cv::Mat& wide,
                      const Eigen::Matrix2d& picture_from_anchor,
                      int n,
                      PatchWindow& window) {
  const double center = wide.cols / 2;
  FillWarpedWindow(wide, {center, center}, picture_from_anchor.inverse(), n, window);
}

// Gauss-Newton for the translation on one level; `x` in px of the level. None where the window has
// no texture.
std::optional<Eigen::Vector2d> Align(const cv::Mat& picture,
                                     const PatchWindow& window,
                                     int max_iterations,
                                     const Eigen::Matrix2d& prior,
                                     Eigen::Vector2d x) {
  const Eigen::Vector2d start = x;
  for (int i = 0; i < max_iterations; ++i) {
    const auto [hessian, gradient] = LinearizeTranslation(picture, x, window);
    const Eigen::Matrix2d H = hessian + prior;
    if (!(H.determinant() > 1e-12)) return std::nullopt;
    Eigen::Vector2d step = -H.inverse() * (gradient + prior * (x - start));
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
void Compare(const PatchWindow& seen, const PatchWindow& window, Measurement& m) {
  const double area = window.n * window.n;
  const auto [vv, tt, vt, absolute] = CompareWindows(seen, window);
  m.correlation = vv > 0.0 && tt > 0.0 ? vt / std::sqrt(vv * tt) : 0.0;
  m.residual_variance = std::max(0.0, (vv + tt - 2.0 * vt) / area);
  m.residual = absolute / area;
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
              const PatchWindow& window,
              double noise_factor,
              const AnchorPatch& anchor,
              const Eigen::Vector2d& start,
              const Eigen::Matrix2d& prior,
              Measurement& m) {
  const int area = window.n * window.n;
  PatchWindow seen;
  FillWindow(picture, m.xy, window.n, seen);
  Compare(seen, window, m);
  const auto [normal, rhs, cross] = LinearizeWarp(seen, window);

  const double variance = std::max(m.residual_variance, 1e-6) * noise_factor;
  Matrix7d information = normal / variance;
  Vector7d b = rhs / variance;
  information.block<4, 4>(2, 2) +=
      (anchor.warp_covariance + 1e-10 * Eigen::Matrix4d::Identity()).inverse();
  const Matrix7d likelihood = information.ldlt().solve(Matrix7d::Identity());
  m.gradients =
      (anchor.gradients_count * anchor.gradients + cross / area) / (anchor.gradients_count + 1.0);
  m.shape = Sandwich(likelihood.topLeftCorner<2, 2>() / noise_factor,
                     normal.topLeftCorner<2, 2>() / area,
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

AnchorPatch CopyAnchor(const Pyramid& pyramid,
                       const Eigen::Vector2d& xy,
                       int largest_px,
                       const Eigen::Matrix2d& warp) {
  const int side = largest_px + 2 * MarginOf(largest_px);
  AnchorPatch anchor;
  anchor.full = CopyPatch(pyramid.levels[0], xy, warp, side);
  if (pyramid.levels.size() > 1) anchor.half = CopyPatch(pyramid.levels[1], xy / 2, warp, side);
  return anchor;
}

AnchorPatch TakeAnchor(const Pyramid& pyramid,
                       const Eigen::Vector2d& xy,
                       int window_px,
                       int largest_px) {
  AnchorPatch anchor = CopyAnchor(pyramid, xy, largest_px, Eigen::Matrix2d::Identity());
  PatchWindow window;
  FillAnchorWindow(anchor.full, anchor.warp, window_px, window);
  const WindowComparison sums = CompareWindows(window, window);
  anchor.signal_variance = sums.squares / (window_px * window_px);
  double gradient = 0.0;
  for (int i = 0; i < window.n * window.stride; ++i) {
    gradient += window.dx[i] * window.dx[i] + window.dy[i] * window.dy[i];
  }
  anchor.mean_square_gradient = gradient / (2.0 * window_px * window_px);
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
  PatchWindow window;
  if (!with_prior && !anchor.half.empty()) {
    FillAnchorWindow(anchor.half, anchor.warp, window_px, window);
    const auto half = Align(current.levels[1], window, 10, prior, start / 2);
    // Where the half resolution leads astray, the full one starts from the start.
    if (half && (2 * *half - start).norm() < 6.0) m.xy = 2 * *half;
  }
  FillAnchorWindow(anchor.full, anchor.warp, window_px, window);
  const double variance = noise_variance * noise_factor;
  const auto full = Align(current.levels[0], window, 15, variance * prior, m.xy);
  if (!full) return m;
  m.xy = *full;
  m.converged = true;
  Conclude(current.levels[0], window, noise_factor, anchor, start, prior, m);
  return m;
}

CenterDifference CompareCenter(const Pyramid& current,
                               const AnchorPatch& anchor,
                               const Eigen::Vector2d& xy) {
  constexpr int kSide = 9;
  constexpr int kArea = kSide * kSide;
  constexpr int kStride = RoundUpToLanes(kSide);
  float then[kSide * kStride];
  float now[kSide * kStride];
  const double center = anchor.full.cols / 2;
  SampleWarpedInLanes(anchor.full, {center, center}, anchor.warp.inverse(), kSide, then, kStride);
  SamplePatchInLanes(current.levels[0], xy.x(), xy.y(), kSide, now, kStride);
  double sum = 0.0;
  double square = 0.0;
  for (int r = 0; r < kSide; ++r) {
    for (int k = r * kStride; k < r * kStride + kSide; ++k) {
      const double difference = now[k] - then[k];
      sum += difference;
      square += difference * difference;
    }
  }
  const double mean = sum / kArea;
  return {mean, std::max(0.0, square / kArea - mean * mean)};
}

}  // namespace cohort
