#include "frontend/track/trajectory_model/rank.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "frontend/core/in_parallel.h"
#include "frontend/track/trajectory_model/camera_fit.h"
#include "frontend/track/trajectory_model/feature_fit.h"
#include "frontend/track/trajectory_model/noise.h"

namespace cohort::trajectory_model {
namespace {

// Which features may add a coordinate, of every `stride`-th feature.
std::vector<std::uint8_t> MayAdd(const State& state, std::size_t stride) {
  // The number of observations after which a feature is established. Tuned on the tuning clips,
  // with an occluder. In a short window one miss is allowed.
  constexpr std::size_t kEstablished = 8;
  const std::size_t least = std::min(kEstablished, state.frames.size() - 2);
  std::vector<std::uint8_t> may_add(state.features.size(), 0);
  for (std::size_t f = 0; f < may_add.size(); f += stride) {
    may_add[f] = state.rank < kRigidRank || CountObserved(state, f) >= least ? 1 : 0;
  }
  return may_add;
}

struct Residuals {
  std::vector<WhitenedResidual> all;
  // The same as a matrix, 2 N x F, zero without a measurement: rows 2 l, 2 l + 1 belong to frame l.
  Eigen::MatrixXd table;
  // The radial component of each feature's residuals, away from the centre of the picture.
  Eigen::VectorXd radial;
  double sum_of_squares = 0.0;
};

Residuals ResidualsOf(const State& state, std::size_t stride) {
  const auto F = static_cast<Eigen::Index>(state.features.size());
  const auto N = static_cast<Eigen::Index>(state.frames.size());
  Residuals residuals;
  residuals.table = Eigen::MatrixXd::Zero(2 * N, F);
  residuals.radial = Eigen::VectorXd::Zero(F);
  const std::vector<std::uint8_t> may_add = MayAdd(state, stride);
  for (std::size_t l = 0; l < state.frames.size(); ++l) {
    const Frame& frame = state.frames[l];
    const Eigen::Vector2d center = frame.camera.topLeftCorner<2, 1>();
    for (std::size_t f = 0; f < state.features.size(); ++f) {
      const Observation& o = frame.observations[f];
      if (may_add[f] == 0 || !o.IsObserved() || o.anchor) continue;
      const Projection at = Project(frame.camera, state.features[f].mean);
      const Eigen::Vector2d d = Residual(at, o, state.features[f]);
      const double weight = std::sqrt(StudentWeight(d.dot(o.information * d)));
      const Eigen::Matrix2d root = weight * Eigen::Matrix2d(o.information.llt().matrixU());
      residuals.all.push_back({l, f, root * d, root * at.of_homogeneous});
      residuals.table.block<2, 1>(2 * static_cast<Eigen::Index>(l), static_cast<Eigen::Index>(f)) =
          root * d;
      residuals.radial[static_cast<Eigen::Index>(f)] +=
          d.dot(at.xy - center) / ((at.xy - center).squaredNorm() + 1.0);
      residuals.sum_of_squares += residuals.all.back().residual.squaredNorm();
    }
  }
  return residuals;
}

// Alternating least squares converge to the nearest optimum. They start from the strongest affine
// direction (sideways motion, another body), and from the one that moves features towards and away
// from their centre (forward motion).
Direction StrongestDirection(const State& state, const Residuals& residuals) {
  const Eigen::MatrixXd& R = residuals.table;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(R * R.transpose());
  const auto fit = [&](Eigen::VectorXd v) {
    return FitDirection(residuals.all, state.frames.size(), state.perspective, std::move(v));
  };
  Direction direction = fit(R.transpose() * eigen.eigenvectors().col(R.rows() - 1));
  if (state.perspective) {
    Direction ahead = fit(residuals.radial);
    if (ahead.explained > direction.explained) direction = std::move(ahead);
  }
  return direction;
}

// The cameras' last column, and the coordinate before the anchor's error.
void AddCoordinate(const Direction& direction, State& state) {
  constexpr double kFirstVariance = 0.1;  // until FitFeature estimates it
  const Eigen::Index r = state.rank;
  state.rank = static_cast<int>(r) + 1;
  for (std::size_t l = 0; l < state.frames.size(); ++l) {
    Camera& camera = state.frames[l].camera;
    camera.conservativeResize(3, r + 2);
    camera.col(r + 1) = direction.g.col(static_cast<Eigen::Index>(l));
  }
  for (std::size_t f = 0; f < state.features.size(); ++f) {
    FeaturePosterior& feature = state.features[f];
    Vector mean(r + 3);
    mean << feature.mean.head(r), direction.v[static_cast<Eigen::Index>(f)], feature.mean.tail<2>();
    Matrix covariance = Matrix::Zero(r + 3, r + 3);
    covariance.topLeftCorner(r, r) = feature.covariance.topLeftCorner(r, r);
    covariance.bottomRightCorner<2, 2>() = feature.covariance.bottomRightCorner<2, 2>();
    covariance.block(0, r + 1, r, 2) = feature.covariance.topRightCorner(r, 2);
    covariance.block(r + 1, 0, 2, r) = feature.covariance.bottomLeftCorner(2, r);
    covariance(r, r) = kFirstVariance;
    feature.mean = mean;
    feature.covariance = covariance;
  }
}

}  // namespace

void BeginWithPositions(State& state) {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d S = Eigen::Matrix2d::Zero();
  const double count = static_cast<double>(state.features.size());
  const std::vector<Observation>& observations = state.frames.front().observations;
  for (const Observation& o : observations) mean += o.xy / count;
  for (const Observation& o : observations) {
    S += (o.xy - mean) * (o.xy - mean).transpose() / count;
  }
  state.rank = 2;
  for (Frame& frame : state.frames) {
    frame.camera.setZero(3, 3);
    frame.camera.topRows<2>() << mean, Eigen::Matrix2d(S.llt().matrixL());
    frame.camera(2, 0) = 1.0;
  }
  FitAllFeatures(state);
}

Direction FitDirection(std::span<const WhitenedResidual> residuals,
                       std::size_t frames,
                       bool perspective,
                       Eigen::VectorXd v) {
  constexpr int kMostIterations = 10;
  constexpr double kLeastGain = 0.02;  // of the explained sum
  const auto N = static_cast<Eigen::Index>(frames);
  Direction direction{std::move(v), Eigen::Matrix3Xd::Zero(3, N)};
  for (int i = 0; i < kMostIterations; ++i) {
    const double before = direction.explained;
    std::vector<Eigen::Matrix3d> normals(frames, 1e-12 * Eigen::Matrix3d::Identity());
    Eigen::Matrix3Xd rhs = Eigen::Matrix3Xd::Zero(3, N);
    for (const WhitenedResidual& w : residuals) {
      const double of_v = direction.v[static_cast<Eigen::Index>(w.feature)];
      const Eigen::Matrix<double, 2, 3> J = of_v * w.J;
      normals[w.frame] += J.transpose() * J;
      rhs.col(static_cast<Eigen::Index>(w.frame)) += J.transpose() * w.residual;
    }
    direction.explained = 0.0;
    for (Eigen::Index l = 0; l < N; ++l) {
      Eigen::Matrix3d& normal = normals[static_cast<std::size_t>(l)];
      if (!perspective) normal(2, 2) += 1e6 * normal.trace();
      direction.g.col(l) = normal.ldlt().solve(rhs.col(l));
      direction.explained += direction.g.col(l).dot(rhs.col(l));
    }
    if (i > 0 && direction.explained - before < kLeastGain * before) break;
    Eigen::VectorXd numerator = Eigen::VectorXd::Zero(direction.v.size());
    Eigen::VectorXd denominator = Eigen::VectorXd::Constant(direction.v.size(), 1e-12);
    for (const WhitenedResidual& w : residuals) {
      const auto f = static_cast<Eigen::Index>(w.feature);
      const Eigen::Vector2d J = w.J * direction.g.col(static_cast<Eigen::Index>(w.frame));
      numerator[f] += J.dot(w.residual);
      denominator[f] += J.squaredNorm();
    }
    direction.v = numerator.cwiseQuotient(denominator);
    direction.v *= std::sqrt(static_cast<double>(direction.v.size())) / direction.v.norm();
  }
  return direction;
}

double EdgeOfNoise(std::size_t features, std::size_t frames, bool perspective) {
  const double columns = perspective ? 3.0 : 2.0;
  return std::pow(
      std::sqrt(static_cast<double>(features)) + std::sqrt(columns * static_cast<double>(frames)),
      2);
}

namespace {

// The missing direction, from every `stride`-th feature; nullopt if noise would explain it.
std::optional<Direction> MissingDirection(const State& state, std::size_t stride) {
  constexpr std::size_t kLeastResiduals = 20;
  // As a share of the edge of noise. Noise itself reaches 0.6 here, because the fit has removed a
  // part of it. Up to the three coordinates of a rigid scene, one too many does no harm; beyond
  // them it would.
  const double least_strength = state.rank < kRigidRank ? 0.5 : 1.0;
  const Residuals residuals = ResidualsOf(state, stride);
  if (residuals.all.size() < kLeastResiduals) return std::nullopt;
  Direction direction = StrongestDirection(state, residuals);
  // Relative to the actual noise, if that exceeds what the measurements state.
  const double variance =
      std::max(1.0, residuals.sum_of_squares / (2.0 * static_cast<double>(residuals.all.size())));
  const std::size_t asked = (state.features.size() + stride - 1) / stride;
  const double edge = EdgeOfNoise(asked, state.frames.size(), state.perspective);
  if (direction.explained < least_strength * edge * variance) return std::nullopt;
  return direction;
}

}  // namespace

void AdaptRank(State& state, int max_rank) {
  constexpr std::size_t kFeaturesPerRank = 2;
  constexpr std::size_t kEnough = 500;  // features, to detect a missing direction
  const auto needed = kFeaturesPerRank * (static_cast<std::size_t>(state.rank) + 1);
  if (state.rank >= max_rank || needed > state.features.size()) return;
  const std::size_t stride = 1 + state.features.size() / kEnough;
  std::optional<Direction> direction = MissingDirection(state, stride);
  if (direction && stride > 1) direction = MissingDirection(state, 1);
  if (!direction) return;
  AddCoordinate(*direction, state);
  ForEachInParallel(state.frames.size(),
                    [&](std::size_t l) { RefitCamera(state, state.frames[l]); });
  FitAllFeatures(state);
}

}  // namespace cohort::trajectory_model
