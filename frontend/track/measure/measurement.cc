#include "frontend/track/measure/measurement.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <optional>

#include "frontend/core/error.h"
#include "frontend/image/sampling.h"
#include "frontend/track/measure/patch_window.h"

namespace cohort {
namespace {

int MarginOf(int window_px) { return std::min(window_px / 2, (kMaxPatchSide - window_px) / 2); }

int SideFor(int window_px) { return window_px + 2 * MarginOf(window_px); }

cv::Mat CopyPatch(const cv::Mat& picture,
                  const Eigen::Vector2d& xy,
                  const Eigen::Matrix2d& warp,
                  int side) {
  if (!warp.isIdentity() && std::min(picture.cols, picture.rows) < 2) {
    cv::Mat wide;  // four neighbours of every pixel
    cv::copyMakeBorder(picture, wide, 0, 1, 0, 1, cv::BORDER_REPLICATE);
    return CopyPatch(wide, xy, warp, side);
  }
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
  const int center = wide.cols / 2;
  FillWarpedWindow(
      wide, Eigen::Vector2d::Constant(center), picture_from_anchor.inverse(), n, window);
}

// Noise has gradients too, which Gauss-Newton's Hessian takes for texture, so that its steps are
// too short. The windows' gradients with each other have none of it in expectation, and their steps
// lead to the same minimum; but they may be anything where there is next to no texture.
Eigen::Matrix2d CurvatureOf(const TranslationEquations& equations) {
  constexpr double kLeastShare = 0.3;
  const Eigen::Matrix2d rest = equations.cross - kLeastShare * equations.hessian;
  return rest(0, 0) > 0.0 && rest.determinant() > 0.0 ? equations.cross : equations.hessian;
}

// What is nothing beside the steps of the intensities depends on how fine they are.
double InStepsOf8Bits(const Pyramid& pyramid) { return 255.0 * pyramid.step; }

constexpr double kUnbounded = std::numeric_limits<double>::infinity();

// Gauss-Newton for the translation on one level; `x` in px of the level. None where the window has
// no texture. Ends where it is further from its start than `reach_px`.
std::optional<Eigen::Vector2d> Align(const Pyramid& pyramid,
                                     std::size_t level,
                                     const PatchWindow& window,
                                     int max_iterations,
                                     const Eigen::Matrix2d& prior,
                                     Eigen::Vector2d x,
                                     double reach_px = kUnbounded) {
  // If no step is ever small: slow is not wrong, the tests on the result decide.
  constexpr double kSmallStepPx = 0.01;
  constexpr double kMaxStepPx = 2.0;
  constexpr double kNoTexture = 1e-12;  // of 8 bits
  constexpr double kLeastStretch = 0.4;
  constexpr double kMostStretch = 3.0;
  const cv::Mat& picture = pyramid.levels[level];
  const double least_determinant = kNoTexture * std::pow(InStepsOf8Bits(pyramid), 4);
  const Eigen::Vector2d start = x;
  Eigen::Vector2d newton_before = Eigen::Vector2d::Zero();
  Eigen::Vector2d moved = Eigen::Vector2d::Zero();
  for (int i = 0; i < max_iterations; ++i) {
    const TranslationEquations equations = LinearizeTranslation(picture, x, window);
    const Eigen::Matrix2d H = CurvatureOf(equations) + prior;
    if (!(H.determinant() > least_determinant)) return std::nullopt;
    const Eigen::Vector2d newton = -H.inverse() * (equations.gradient + prior * (x - start));
    if (!newton.allFinite()) return std::nullopt;
    if (newton.norm() < kSmallStepPx) return x + newton;
    // Steps that shrink slowly are too short, those that turn back too long: the secant says by how
    // much (Barzilai and Borwein's step).
    double stretch = 1.0;
    if (i > 0) {
      const double slope = (newton_before - newton).dot(moved);
      stretch = slope > 0.0 ? moved.squaredNorm() / slope : kMostStretch;
      stretch = std::clamp(stretch, kLeastStretch, kMostStretch);
    }
    moved = stretch * newton;
    const double length = moved.norm();
    if (length > kMaxStepPx) moved *= kMaxStepPx / length;
    x += moved;
    newton_before = newton;
    if ((x - start).norm() > reach_px) return x;
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

constexpr int kCenterPx = 9;  // side of the innermost pixels

CenterDifference Difference(const float* now, const float* then, int n, int stride) {
  double sum = 0.0;
  double square = 0.0;
  for (int r = 0; r < n; ++r) {
    for (int k = r * stride; k < r * stride + n; ++k) {
      const double difference = now[k] - then[k];
      sum += difference;
      square += difference * difference;
    }
  }
  const double area = n * n;
  const double mean = sum / area;
  return {mean, std::max(0.0, square / area - mean * mean)};
}

CenterDifference DifferenceOfCenters(const PatchWindow& seen, const PatchWindow& window) {
  const int n = std::min(kCenterPx, window.n);
  const int at = (window.n - n) / 2 * (window.stride + 1);
  return Difference(seen.values + at, window.values + at, n, window.stride);
}

// How anchor and picture at m.xy look alike.
void Compare(const PatchWindow& seen, const PatchWindow& window, Measurement& m) {
  const double area = window.n * window.n;
  const auto [vv, tt, vt, absolute] = CompareWindows(seen, window);
  m.correlation = vv > 0.0 && tt > 0.0 ? vt / std::sqrt(vv * tt) : 0.0;
  m.residual_variance = std::max(0.0, (vv + tt - 2.0 * vt) / area);
  m.residual = absolute / area;
  m.center = DifferenceOfCenters(seen, window);
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
void Conclude(const Pyramid& pyramid,
              const PatchWindow& window,
              double noise_factor,
              const AnchorPatch& anchor,
              const Eigen::Vector2d& start,
              const Eigen::Matrix2d& prior,
              Measurement& m) {
  const int area = window.n * window.n;
  PatchWindow seen;
  FillWindow(pyramid.levels[0], m.xy, window.n, seen);
  Compare(seen, window, m);
  const auto [normal, rhs, cross] = LinearizeWarp(seen, window);

  constexpr double kLeastVariance = 1e-6;  // of 8 bits
  const double least = kLeastVariance * std::pow(InStepsOf8Bits(pyramid), 2);
  const double variance = std::max(m.residual_variance, least) * noise_factor;
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
  const int side = SideFor(largest_px);
  AnchorPatch anchor;
  anchor.full = CopyPatch(pyramid.levels[0], xy, warp, side);
  if (pyramid.levels.size() > 1) anchor.half = CopyPatch(pyramid.levels[1], xy / 2, warp, side);
  return anchor;
}

void NarrowAnchor(int largest_px, AnchorPatch& anchor) {
  const int side = SideFor(largest_px);
  for (cv::Mat* picture : {&anchor.full, &anchor.half}) {
    const int rim = (picture->cols - side) / 2;
    if (rim > 0) *picture = (*picture)(cv::Rect(rim, rim, side, side)).clone();
  }
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

double ExpectedCorrelation(double first_variance, double first_noise, double second_noise) {
  const double signal = first_variance - first_noise;
  if (!(signal > 0.0)) return 0.0;
  return signal / std::sqrt(first_variance * (signal + second_noise));
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
  FillAnchorWindow(anchor.full, anchor.warp, window_px, window);
  const Eigen::Matrix2d full_prior = noise_variance * noise_factor * prior;
  const auto align = [&](const Eigen::Vector2d& from, double reach_px) {
    return Align(current, 0, window, 15, full_prior, from, reach_px);
  };
  // The half resolution finds what is further off, and misleads now and then.
  constexpr double kNearPx = 1.5;
  constexpr double kAstrayPx = 6.0;
  const bool has_half = !with_prior && !anchor.half.empty();
  auto full = align(start, has_half ? kNearPx : kUnbounded);
  if (has_half && !(full && (*full - start).norm() <= kNearPx)) {
    PatchWindow half_window;
    FillAnchorWindow(anchor.half, anchor.warp, window_px, half_window);
    const auto half = Align(current, 1, half_window, 10, prior, start / 2);
    const bool leads = half && (2 * *half - start).norm() < kAstrayPx;
    full = align(leads ? 2 * *half : start, kUnbounded);
  }
  if (!full) return m;
  m.xy = *full;
  m.converged = true;
  Conclude(current, window, noise_factor, anchor, start, prior, m);
  return m;
}

std::optional<Eigen::Vector2d> TrackWindow(const Pyramid& from,
                                           const Pyramid& to,
                                           const Eigen::Vector2d& xy,
                                           const Eigen::Vector2d& start,
                                           int window_px,
                                           int finest_level) {
  constexpr int kMaxIterations = 15;
  constexpr double kLeastCorrelation = 0.3;
  Eigen::Vector2d displacement = start - xy;
  const int coarsest = static_cast<int>(from.levels.size()) - 1;
  const int finest = std::min(finest_level, coarsest);
  for (int level = coarsest; level >= finest; --level) {
    const double scale = std::ldexp(1.0, -level);
    const auto l = static_cast<std::size_t>(level);
    PatchWindow window;
    FillWindow(from.levels[l], scale * xy, window_px, window);
    const auto found =
        Align(to, l, window, kMaxIterations, Eigen::Matrix2d::Zero(), scale * (xy + displacement));
    if (!found) return std::nullopt;
    displacement = *found / scale - xy;
    if (level > finest) continue;
    PatchWindow there;
    FillWindow(to.levels[l], *found, window_px, there);
    const auto [vv, tt, vt, absolute] = CompareWindows(there, window);
    // Nothing, such as black, is no likeness: it has no variance, and 0 >= 0.
    if (!(vt > 0.0 && vt >= kLeastCorrelation * std::sqrt(vv * tt))) return std::nullopt;
  }
  return xy + displacement;
}

CenterDifference CompareCenter(const Pyramid& current,
                               const AnchorPatch& anchor,
                               const Eigen::Vector2d& xy) {
  constexpr int kStride = RoundUpToLanes(kCenterPx);
  float then[kCenterPx * kStride];
  float now[kCenterPx * kStride];
  const int center = anchor.full.cols / 2;
  SampleWarpedInLanes(anchor.full,
                      Eigen::Vector2d::Constant(center),
                      anchor.warp.inverse(),
                      kCenterPx,
                      then,
                      kStride);
  SamplePatchInLanes(current.levels[0], xy.x(), xy.y(), kCenterPx, now, kStride);
  return Difference(now, then, kCenterPx, kStride);
}

}  // namespace cohort
