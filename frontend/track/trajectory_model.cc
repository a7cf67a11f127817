#include "frontend/track/trajectory_model.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "frontend/core/error.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr std::ptrdiff_t kLeastSeen = 8;
constexpr std::size_t kLeastSteps = 4;
constexpr double kUnknownDepthPx = 1.5;
constexpr double kMedianChiSquare = 1.386;  // of two degrees of freedom
constexpr double kFreedom = 4.0;            // of Student's t

// Prior of the error of an anchor that was not seen again yet [1/px^2].
const Eigen::Matrix2d kUnseenAnchor = 4.0 * Eigen::Matrix2d::Identity();

bool Seen(const TrajectoryModel::Observation& o) { return o.information(0, 0) > 0.0; }

double StudentWeight(double square) { return (kFreedom + 2.0) / (kFreedom + square); }

}  // namespace

// y - m - B z - e
Eigen::Vector2d TrajectoryModel::Residual(const Loadings& loadings,
                                          const Observation& o,
                                          const Feature& feature) const {
  Eigen::Vector2d d = o.xy - loadings.col(0) - loadings.rightCols(rank_) * feature.mean.head(rank_);
  if (!o.anchor) d -= feature.mean.tail<2>();
  return d;
}

// Generalised least squares: a feature's say is what its own noise and the uncertainty of its
// coordinates leave.
TrajectoryModel::Fit TrajectoryModel::FitLoadings(std::span<const Observation> now) const {
  const Eigen::Index r = rank_;
  const Eigen::Index n = 2 * (r + 1);
  Fit fit;
  fit.loadings = frames_.front().loadings;
  std::vector<std::size_t> seen;
  for (std::size_t f = 0; f < now.size(); ++f) {
    if (Seen(now[f])) seen.push_back(f);
  }
  // What the features seen do not tell moves on as it did from frame to frame before.
  const Eigen::Map<const Eigen::VectorXd> before(frames_.front().loadings.data(), n);
  Eigen::VectorXd prior = Eigen::VectorXd::Constant(n, 1e-6);
  if (frames_.size() > kLeastSteps) {
    Eigen::VectorXd squares = Eigen::VectorXd::Zero(n);
    for (std::size_t l = 0; l + 1 < frames_.size(); ++l) {
      squares += (frames_[l].loadings - frames_[l + 1].loadings).reshaped().cwiseAbs2();
    }
    squares /= static_cast<double>(frames_.size() - 1);
    prior = squares.cwiseMax(1e-8).cwiseInverse();
  }
  std::vector<double> weights(seen.size(), 1.0);
  for (int pass = 0; pass < 6; ++pass) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd rhs = Eigen::VectorXd::Zero(n);
    std::vector<Eigen::Matrix2d> informations(seen.size());
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const Feature& feature = features_[seen[i]];
      const Observation& o = now[seen[i]];
      Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxDimensions> J(2, r + 2);
      J.leftCols(r) = fit.loadings.rightCols(r);
      J.rightCols(2) =
          o.anchor ? Eigen::Matrix2d::Zero().eval() : Eigen::Matrix2d::Identity().eval();
      const Eigen::Matrix2d S = o.information.inverse() + J * feature.covariance * J.transpose();
      informations[i] = S.inverse();
      const Eigen::Matrix2d W = weights[i] * informations[i];
      Vector z(r + 1);
      z << 1.0, feature.mean.head(r);
      const Eigen::Vector2d y = o.anchor ? o.xy : Eigen::Vector2d(o.xy - feature.mean.tail<2>());
      const Eigen::Vector2d Wy = W * y;
      for (Eigen::Index p = 0; p <= r; ++p) {
        rhs.segment<2>(2 * p) += z[p] * Wy;
        for (Eigen::Index q = 0; q <= p; ++q) normal.block<2, 2>(2 * p, 2 * q) += z[p] * z[q] * W;
      }
    }
    normal = Eigen::MatrixXd(normal.selfadjointView<Eigen::Lower>());
    normal.diagonal() += prior;
    rhs += prior.cwiseProduct(before);
    const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
    const Eigen::VectorXd solution = solver.solve(rhs);
    for (Eigen::Index p = 0; p <= r; ++p) fit.loadings.col(p) = solution.segment<2>(2 * p);
    if (pass == 5) {
      fit.covariance = solver.solve(Eigen::MatrixXd::Identity(n, n));
      break;
    }
    std::vector<double> squares;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const Eigen::Vector2d d = Residual(fit.loadings, now[seen[i]], features_[seen[i]]);
      squares.push_back(d.dot(informations[i] * d));
    }
    const double scale = std::max(1.0, Median(squares) / kMedianChiSquare);
    for (std::size_t i = 0; i < seen.size(); ++i) {
      weights[i] = StudentWeight(squares[i] / scale);
    }
  }
  return fit;
}

TrajectoryModel::Estimate TrajectoryModel::Of(const Fit& fit, const Feature& feature) const {
  const Eigen::Index r = rank_;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxDimensions> J(2, r + 2);
  J.leftCols(r) = fit.loadings.rightCols(r);
  J.rightCols(2).setZero();
  Vector z(r + 1);
  z << 1.0, feature.mean.head(r);
  Eigen::Matrix2d of_loadings = Eigen::Matrix2d::Zero();
  for (Eigen::Index p = 0; p <= r; ++p) {
    for (Eigen::Index q = 0; q <= r; ++q) {
      of_loadings += z[p] * z[q] * fit.covariance.block<2, 2>(2 * p, 2 * q);
    }
  }
  // A rigid scene has depth, whose dimension may not have shown yet.
  if (rank_ < 3) of_loadings += kUnknownDepthPx * kUnknownDepthPx * Eigen::Matrix2d::Identity();
  Estimate e;
  e.xy = fit.loadings * z;
  e.covariance = J * feature.covariance * J.transpose() + of_loadings;
  e.measured_xy = e.xy + feature.mean.tail<2>();
  J.rightCols(2).setIdentity();
  e.measured_covariance = J * feature.covariance * J.transpose() + of_loadings;
  return e;
}

bool TrajectoryModel::CanFit(std::span<const Observation> now) const {
  return !frames_.empty() && rank_ > 0 && std::count_if(now.begin(), now.end(), Seen) >= kLeastSeen;
}

std::vector<TrajectoryModel::Estimate> TrajectoryModel::All(const Fit& fit) const {
  std::vector<Estimate> estimates;
  estimates.reserve(features_.size());
  for (const Feature& feature : features_) estimates.push_back(Of(fit, feature));
  return estimates;
}

std::vector<TrajectoryModel::Estimate> TrajectoryModel::Predict(
    std::span<const Observation> now) const {
  if (!CanFit(now)) return {};
  return All(FitLoadings(now));
}

// The posterior of (z, e) from all frames in the window.
void TrajectoryModel::InferFeature(std::size_t f) {
  const Eigen::Index r = rank_;
  Feature& feature = features_[f];
  Matrix information = Matrix::Zero(r + 2, r + 2);
  Vector rhs = Vector::Zero(r + 2);
  const bool had_mean = feature.mean.size() == r + 2;
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  int count = 0;
  for (const Frame& frame : frames_) {
    const Observation& o = frame.observations[f];
    if (!Seen(o)) continue;
    const auto B = frame.loadings.rightCols(r);
    const Eigen::Vector2d y = o.xy - frame.loadings.col(0);
    Eigen::Matrix2d W = o.information;
    if (had_mean && !o.anchor) {
      const Eigen::Vector2d d = Residual(frame.loadings, o, feature);
      W *= StudentWeight(d.dot(W * d));
    }
    const Loadings WB = W * B;
    information.topLeftCorner(r, r).noalias() += B.transpose() * WB;
    rhs.head(r).noalias() += WB.transpose() * y;
    if (!o.anchor) {
      information.bottomLeftCorner(2, r) += WB;
      information.bottomRightCorner<2, 2>() += W;
      rhs.tail<2>() += W * y;
      sum += o.information;
      ++count;
    }
  }
  // The anchor is as noisy as any picture.
  const Eigen::Matrix2d of_anchor =
      count > 0 ? Eigen::Matrix2d(sum / count) : Eigen::Matrix2d(kUnseenAnchor);
  information.topRightCorner(r, 2) = information.bottomLeftCorner(2, r).transpose();
  information.diagonal().head(r).array() += 1.0;
  information.bottomRightCorner<2, 2>() += of_anchor;
  feature.covariance = information.llt().solve(Matrix::Identity(r + 2, r + 2));
  feature.mean = feature.covariance * rhs;
}

void TrajectoryModel::RefitLoadings(Frame& frame) const {
  const Eigen::Index r = rank_;
  const Eigen::Index n = 2 * (r + 1);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(n);
  for (std::size_t f = 0; f < features_.size(); ++f) {
    const Observation& o = frame.observations[f];
    if (!Seen(o)) continue;
    const Feature& feature = features_[f];
    const Eigen::Vector2d e =
        o.anchor ? Eigen::Vector2d::Zero().eval() : Eigen::Vector2d(feature.mean.tail<2>());
    Eigen::Matrix2d W = o.information;
    const Eigen::Vector2d y = o.xy - e;
    const Eigen::Vector2d d = Residual(frame.loadings, o, feature);
    W *= StudentWeight(d.dot(W * d));
    Vector z(r + 1);
    z << 1.0, feature.mean.head(r);
    Matrix zz = z * z.transpose();
    zz.bottomRightCorner(r, r) += feature.covariance.topLeftCorner(r, r);
    const Eigen::Vector2d Wy = W * y;
    for (Eigen::Index p = 0; p <= r; ++p) {
      rhs.segment<2>(2 * p) += z[p] * Wy;
      if (!o.anchor && p > 0) {
        rhs.segment<2>(2 * p) -= W * feature.covariance.block<1, 2>(p - 1, r).transpose();
      }
      for (Eigen::Index q = 0; q <= p; ++q) normal.block<2, 2>(2 * p, 2 * q) += zz(p, q) * W;
    }
  }
  normal = Eigen::MatrixXd(normal.selfadjointView<Eigen::Lower>());
  const double little = 1e-9 * normal.trace() + 1e-300;
  normal.diagonal().array() += little;
  for (Eigen::Index p = 0; p <= r; ++p) rhs.segment<2>(2 * p) += little * frame.loadings.col(p);
  const Eigen::VectorXd solution = normal.ldlt().solve(rhs);
  for (Eigen::Index p = 0; p <= r; ++p) frame.loadings.col(p) = solution.segment<2>(2 * p);
}

// The coordinates are defined up to an affine map: the one that makes their prior the cohort's own
// distribution, and the axes those of the frames.
void TrajectoryModel::Normalize() {
  const Eigen::Index r = rank_;
  const double F = static_cast<double>(features_.size());
  Vector mean = Vector::Zero(r);
  for (const Feature& f : features_) mean += f.mean.head(r) / F;
  Matrix S = Matrix::Zero(r, r);
  for (const Feature& f : features_) {
    const Vector d = f.mean.head(r) - mean;
    S += (d * d.transpose() + f.covariance.topLeftCorner(r, r)) / F;
  }
  S.diagonal().array() += 1e-12;
  const Matrix root = S.llt().matrixL();
  const Matrix inverse = root.triangularView<Eigen::Lower>().solve(Matrix::Identity(r, r));
  for (Frame& frame : frames_) {
    frame.loadings.col(0) += frame.loadings.rightCols(r) * mean;
    frame.loadings.rightCols(r) *= root;
  }
  for (Feature& f : features_) {
    f.mean.head(r) = inverse * (f.mean.head(r) - mean);
    f.covariance.topLeftCorner(r, r) =
        inverse * f.covariance.topLeftCorner(r, r) * inverse.transpose();
    f.covariance.topRightCorner(r, 2) = inverse * f.covariance.topRightCorner(r, 2);
    f.covariance.bottomLeftCorner(2, r) = f.covariance.topRightCorner(r, 2).transpose();
  }
}

// What the residuals, each over its deviation, have in common: their strongest direction against
// the largest that white noise would have.
void TrajectoryModel::AdaptRank() {
  // Below 1, as the fit has taken a part of the noise out of the residuals.
  constexpr double kLeastStrength = 0.5;
  constexpr double kLeastCells = 40.0;
  constexpr Eigen::Index kFeaturesPerRank = 2;
  const Eigen::Index r = rank_;
  const auto F = static_cast<Eigen::Index>(features_.size());
  const auto N = static_cast<Eigen::Index>(frames_.size());
  if (rank_ >= max_rank_ || kFeaturesPerRank * (r + 1) > F) return;
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(2 * N, F);
  for (Eigen::Index l = 0; l < N; ++l) {
    const Frame& frame = frames_[static_cast<std::size_t>(l)];
    for (Eigen::Index f = 0; f < F; ++f) {
      const Observation& o = frame.observations[static_cast<std::size_t>(f)];
      if (!Seen(o) || o.anchor) continue;
      const Eigen::Vector2d d = Residual(frame.loadings, o, features_[static_cast<std::size_t>(f)]);
      R.block<2, 1>(2 * l, f) = std::sqrt(StudentWeight(d.dot(o.information * d))) *
                                (Eigen::Matrix2d(o.information.llt().matrixU()) * d);
    }
  }
  // Over the noise that is there, should it be more than the measurements state.
  double total = 0.0;
  double cells = 0.0;
  for (Eigen::Index i = 0; i < R.size(); ++i) {
    if (R.data()[i] != 0.0) {
      total += R.data()[i] * R.data()[i];
      cells += 1.0;
    }
  }
  if (cells < kLeastCells) return;
  const double variance = std::max(1.0, total / cells);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(R * R.transpose());
  const double strongest = eigen.eigenvalues()[2 * N - 1];
  const double edge = std::pow(std::sqrt(static_cast<double>(F)) + std::sqrt(2.0 * N), 2);
  if (strongest < kLeastStrength * edge * variance) return;
  const Eigen::VectorXd v = (R.transpose() * eigen.eigenvectors().col(2 * N - 1)).normalized() *
                            std::sqrt(static_cast<double>(F));
  rank_ = static_cast<int>(r) + 1;
  for (Frame& frame : frames_) {
    frame.loadings.conservativeResize(2, r + 2);
    frame.loadings.col(r + 1).setZero();
  }
  for (Eigen::Index f = 0; f < F; ++f) {
    Feature& feature = features_[static_cast<std::size_t>(f)];
    Vector mean(r + 3);
    mean << feature.mean.head(r), v[f], feature.mean.tail<2>();
    Matrix covariance = Matrix::Zero(r + 3, r + 3);
    covariance.topLeftCorner(r, r) = feature.covariance.topLeftCorner(r, r);
    covariance.bottomRightCorner<2, 2>() = feature.covariance.bottomRightCorner<2, 2>();
    covariance.block(0, r + 1, r, 2) = feature.covariance.topRightCorner(r, 2);
    covariance.block(r + 1, 0, 2, r) = feature.covariance.bottomLeftCorner(2, r);
    covariance(r, r) = 0.1;
    feature.mean = mean;
    feature.covariance = covariance;
  }
  for (Frame& frame : frames_) RefitLoadings(frame);
  for (std::size_t f = 0; f < features_.size(); ++f) InferFeature(f);
}

std::vector<TrajectoryModel::Estimate> TrajectoryModel::Update(std::span<const Observation> now) {
  Check(now.size() == features_.size(), "the model has the tracker's features");
  const bool fits = CanFit(now);
  Frame frame{{now.begin(), now.end()}, Loadings::Zero(2, rank_ + 1)};
  if (fits) {
    frame.loadings = FitLoadings(now).loadings;
  } else if (!frames_.empty()) {
    frame.loadings = frames_.front().loadings;
  }
  frames_.push_front(std::move(frame));
  if (frames_.size() > max_frames_) frames_.pop_back();
  if (rank_ == 0) return {};
  for (std::size_t f = 0; f < features_.size(); ++f) InferFeature(f);
  if (!fits) return {};
  constexpr int kPasses = 2;
  for (int pass = 0; pass < kPasses; ++pass) {
    for (Frame& old : frames_) RefitLoadings(old);
    for (std::size_t f = 0; f < features_.size(); ++f) InferFeature(f);
    Normalize();
  }
  AdaptRank();
  Fit fit = FitLoadings(frames_.front().observations);
  fit.loadings = frames_.front().loadings;
  return All(fit);
}

void TrajectoryModel::Forget(std::size_t feature) {
  Observation& newest = frames_.front().observations[feature];
  if (newest.anchor) return;
  newest = {};
  if (rank_ > 0) InferFeature(feature);
}

void TrajectoryModel::Keep(std::span<const std::uint8_t> keep) {
  Check(keep.size() == features_.size(), "the model has the tracker's features");
  std::size_t kept = 0;
  for (std::size_t f = 0; f < keep.size(); ++f) {
    if (keep[f] == 0) continue;
    if (kept != f) {
      features_[kept] = features_[f];
      for (Frame& frame : frames_) frame.observations[kept] = frame.observations[f];
    }
    ++kept;
  }
  features_.resize(kept);
  for (Frame& frame : frames_) frame.observations.resize(kept);
}

void TrajectoryModel::Add(std::span<const Observation> course) {
  for (std::size_t l = 0; l < frames_.size(); ++l) {
    frames_[l].observations.push_back(l < course.size() ? course[l] : Observation{});
  }
  features_.emplace_back();
  if (rank_ > 0) {
    InferFeature(features_.size() - 1);
    return;
  }
  // The positions of the first features span the first two dimensions.
  if (static_cast<std::ptrdiff_t>(features_.size()) < kLeastSeen) return;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d S = Eigen::Matrix2d::Zero();
  const double F = static_cast<double>(features_.size());
  for (const Observation& o : frames_.front().observations) mean += o.xy / F;
  for (const Observation& o : frames_.front().observations) {
    S += (o.xy - mean) * (o.xy - mean).transpose() / F;
  }
  rank_ = 2;
  for (Frame& frame : frames_) {
    frame.loadings.resize(2, 3);
    frame.loadings << mean, Eigen::Matrix2d(S.llt().matrixL());
  }
  for (std::size_t f = 0; f < features_.size(); ++f) InferFeature(f);
}

}  // namespace cohort
