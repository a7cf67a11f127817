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
constexpr std::size_t kJointFrames = 12;
// A feature seen less often adds no dimension to the three of a rigid scene.
constexpr std::size_t kEstablished = 8;
constexpr double kUnknownDepthPx = 1.5;
constexpr double kLeastDepth = 0.1;  // of the features' mean
// Until the frames tell how cameras move.
constexpr double kFirstStepPx = 1000.0;
constexpr double kFirstStepOfDepth = 0.01;
constexpr double kMedianChiSquare = 1.386;  // of two degrees of freedom
constexpr double kFreedom = 4.0;            // of Student's t

// Prior of the error of an anchor that was not seen again yet [1/px^2].
const Eigen::Matrix2d kUnseenAnchor = 4.0 * Eigen::Matrix2d::Identity();

bool Seen(const TrajectoryModel::Observation& o) { return o.information(0, 0) > 0.0; }

double StudentWeight(double square) { return (kFreedom + 2.0) / (kFreedom + square); }
double StudentCost(double square) { return (kFreedom + 2.0) * std::log1p(square / kFreedom); }

// Of a residual d in the sum of squares; an anchor's is never in doubt.
Eigen::Matrix2d Weight(const TrajectoryModel::Observation& o,
                       const Eigen::Vector2d& d,
                       bool robust,
                       double misfit) {
  if (!robust || o.anchor) return o.information;
  return StudentWeight(d.dot(o.information * d) / misfit) * o.information;
}

}  // namespace

TrajectoryModel::Projection TrajectoryModel::Project(const Camera& camera, const Vector& z) const {
  Eigen::Vector3d p = camera.col(0) + camera.rightCols(rank_) * z.head(rank_);
  const double depth = std::max(p.z(), kLeastDepth);
  Projection projection;
  projection.xy = p.head<2>() / depth;
  projection.of_homogeneous << Eigen::Matrix2d::Identity() / depth, -projection.xy / depth;
  projection.of_z = projection.of_homogeneous * camera.rightCols(rank_);
  return projection;
}

// y - projection - e
Eigen::Vector2d TrajectoryModel::Residual(const Projection& projection,
                                          const Observation& o,
                                          const Feature& feature) const {
  Eigen::Vector2d d = o.xy - projection.xy;
  if (!o.anchor) d -= feature.mean.tail<2>();
  return d;
}

// What the scale of a camera matrix leaves open, and in an affine model its whole last row, stays.
void TrajectoryModel::Fix(Eigen::Ref<Eigen::MatrixXd> normal) const {
  const double much = 1e6 * normal.trace() + 1.0;
  normal(2, 2) += much;
  if (perspective_) return;
  for (Eigen::Index p = 1; p <= rank_; ++p) normal(3 * p + 2, 3 * p + 2) += much;
}

// Generalised least squares, by Gauss-Newton steps: a feature's say is what its own noise and the
// uncertainty of its coordinates leave.
TrajectoryModel::Fit TrajectoryModel::FitCamera(std::span<const Observation> now) const {
  const Eigen::Index r = rank_;
  const Eigen::Index n = 3 * (r + 1);
  Fit fit;
  fit.camera = frames_.front().camera;
  std::vector<std::size_t> seen;
  for (std::size_t f = 0; f < now.size(); ++f) {
    if (Seen(now[f])) seen.push_back(f);
  }
  // What the features seen do not tell moves on as it did from frame to frame before.
  const Camera before = frames_.front().camera;
  Camera steps = Camera::Zero(3, r + 1);
  for (std::size_t l = 0; l + 1 < frames_.size(); ++l) {
    steps += (frames_[l].camera - frames_[l + 1].camera).cwiseAbs2() /
             static_cast<double>(frames_.size() - 1);
  }
  if (frames_.size() <= kLeastSteps) {
    steps.topRows<2>().setConstant(kFirstStepPx * kFirstStepPx);
    steps.row(2).setConstant(kFirstStepOfDepth * kFirstStepOfDepth);
  }
  const Eigen::VectorXd prior = steps.cwiseMax(1e-8).cwiseInverse().reshaped();
  std::vector<double> weights(seen.size(), 1.0);
  constexpr int kPasses = 6;
  for (int pass = 1;; ++pass) {
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
    Eigen::VectorXd rhs = Eigen::VectorXd::Zero(n);
    std::vector<double> squares;
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const Feature& feature = features_[seen[i]];
      const Observation& o = now[seen[i]];
      const Projection at = Project(fit.camera, feature.mean);
      Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxDimensions> J(2, r + 2);
      J.leftCols(r) = at.of_z;
      J.rightCols(2) =
          o.anchor ? Eigen::Matrix2d::Zero().eval() : Eigen::Matrix2d::Identity().eval();
      const Eigen::Matrix2d S = o.information.inverse() + J * feature.covariance * J.transpose();
      const Eigen::Matrix2d information = S.inverse();
      const Eigen::Vector2d d = Residual(at, o, feature);
      squares.push_back(d.dot(information * d));
      const Eigen::Matrix<double, 3, 2> HW =
          weights[i] * at.of_homogeneous.transpose() * information;
      const Eigen::Matrix3d HWH = HW * at.of_homogeneous;
      const Eigen::Vector3d HWd = HW * d;
      Vector z(r + 1);
      z << 1.0, feature.mean.head(r);
      for (Eigen::Index p = 0; p <= r; ++p) {
        rhs.segment<3>(3 * p) += z[p] * HWd;
        for (Eigen::Index q = 0; q <= p; ++q) normal.block<3, 3>(3 * p, 3 * q) += z[p] * z[q] * HWH;
      }
    }
    normal = Eigen::MatrixXd(normal.selfadjointView<Eigen::Lower>());
    normal.diagonal() += prior;
    rhs += prior.cwiseProduct((before - fit.camera).reshaped());
    Fix(normal);
    const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
    fit.camera.reshaped() += solver.solve(rhs);
    if (pass == kPasses) {
      fit.covariance = solver.solve(Eigen::MatrixXd::Identity(n, n));
      return fit;
    }
    const double scale = std::max(1.0, Median(squares) / kMedianChiSquare);
    for (std::size_t i = 0; i < seen.size(); ++i) weights[i] = StudentWeight(squares[i] / scale);
  }
}

TrajectoryModel::Estimate TrajectoryModel::Of(const Fit& fit, const Feature& feature) const {
  const Eigen::Index r = rank_;
  const Projection at = Project(fit.camera, feature.mean);
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxDimensions> J(2, r + 2);
  J.leftCols(r) = at.of_z;
  J.rightCols(2).setZero();
  Vector z(r + 1);
  z << 1.0, feature.mean.head(r);
  Eigen::Matrix3d homogeneous = Eigen::Matrix3d::Zero();
  for (Eigen::Index p = 0; p <= r; ++p) {
    for (Eigen::Index q = 0; q <= r; ++q) {
      homogeneous += z[p] * z[q] * fit.covariance.block<3, 3>(3 * p, 3 * q);
    }
  }
  Eigen::Matrix2d of_camera = at.of_homogeneous * homogeneous * at.of_homogeneous.transpose();
  // A rigid scene has depth, whose dimension may not have shown yet.
  if (rank_ < 3) of_camera += kUnknownDepthPx * kUnknownDepthPx * Eigen::Matrix2d::Identity();
  Estimate e;
  e.xy = at.xy;
  e.covariance = J * feature.covariance * J.transpose() + of_camera;
  e.measured_xy = e.xy + feature.mean.tail<2>();
  J.rightCols(2).setIdentity();
  e.measured_covariance = J * feature.covariance * J.transpose() + of_camera;
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
  return All(FitCamera(now));
}

// The normal equations of (z, e) from all frames in the window, linearised where it was before.
TrajectoryModel::Normal TrajectoryModel::NormalOf(std::size_t f, bool robust) const {
  const Eigen::Index r = rank_;
  const Feature& feature = features_[f];
  Normal normal{Matrix::Zero(r + 2, r + 2), Vector::Zero(r + 2)};
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  int count = 0;
  for (const Frame& frame : frames_) {
    const Observation& o = frame.observations[f];
    if (!Seen(o)) continue;
    const Projection at = Project(frame.camera, feature.mean);
    const Eigen::Vector2d d = Residual(at, o, feature);
    const Eigen::Matrix2d W = Weight(o, d, robust, frame.misfit);
    const auto WJ = (W * at.of_z).eval();
    normal.information.topLeftCorner(r, r).noalias() += at.of_z.transpose() * WJ;
    normal.gradient.head(r).noalias() += WJ.transpose() * d;
    if (!o.anchor) {
      normal.information.bottomLeftCorner(2, r) += WJ;
      normal.information.bottomRightCorner<2, 2>() += W;
      normal.gradient.tail<2>() += W * d;
      sum += o.information;
      ++count;
    }
  }
  // The anchor is as noisy as any picture.
  normal.of_anchor = count > 0 ? Eigen::Matrix2d(sum / count) : Eigen::Matrix2d(kUnseenAnchor);
  normal.information.topRightCorner(r, 2) = normal.information.bottomLeftCorner(2, r).transpose();
  normal.information.diagonal().head(r).array() += 1.0;
  normal.information.bottomRightCorner<2, 2>() += normal.of_anchor;
  normal.gradient.head(r) -= feature.mean.head(r);
  normal.gradient.tail<2>() -= normal.of_anchor * feature.mean.tail<2>();
  return normal;
}

// Twice the negative logarithm of the posterior, up to a constant.
double TrajectoryModel::Cost(std::size_t f, const Eigen::Matrix2d& of_anchor, bool robust) const {
  const Feature& feature = features_[f];
  double cost = feature.mean.head(rank_).squaredNorm() +
                feature.mean.tail<2>().dot(of_anchor * feature.mean.tail<2>());
  for (const Frame& frame : frames_) {
    const Observation& o = frame.observations[f];
    if (!Seen(o)) continue;
    const Eigen::Vector2d d = Residual(Project(frame.camera, feature.mean), o, feature);
    const double square = d.dot(o.information * d);
    cost += robust && !o.anchor ? frame.misfit * StudentCost(square / frame.misfit) : square;
  }
  return cost;
}

// The posterior of (z, e). A step is shortened until it explains the measurements better: across a
// camera's plane at infinity a full one leads anywhere.
void TrajectoryModel::InferFeature(std::size_t f) {
  constexpr int kFirstSteps = 8;
  constexpr int kHalvings = 5;
  Feature& feature = features_[f];
  const bool is_new = feature.mean.size() != rank_ + 2;
  if (is_new) feature.mean = Vector::Zero(rank_ + 2);
  for (int i = 0; i < (is_new ? kFirstSteps : 1); ++i) {
    const bool robust = !is_new || i > 0;
    const Normal normal = NormalOf(f, robust);
    feature.covariance = normal.information.llt().solve(Matrix::Identity(rank_ + 2, rank_ + 2));
    const Vector before = feature.mean;
    Vector step = feature.covariance * normal.gradient;
    const double cost = Cost(f, normal.of_anchor, robust);
    for (int halving = 0;; ++halving, step *= 0.5) {
      feature.mean = before + step;
      if (Cost(f, normal.of_anchor, robust) <= cost) break;
      if (halving == kHalvings) {
        feature.mean = before;
        return;
      }
    }
  }
}

// A feature's unknowns, taken out of the joint normal equations (Schur complement).
struct TrajectoryModel::Eliminated {
  struct Coupling {  // with the frame's camera: [1 z] (x) block
    Eigen::Index frame;
    Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxDimensions> block;
  };
  Vector extended;  // [1 z]
  Eigen::Matrix2d of_anchor;
  Matrix covariance;
  Vector step;  // if the cameras stay
  std::vector<Coupling> couplings;
};

// Adds a feature to the normal equations of the newest cameras; only their lower triangle counts.
TrajectoryModel::Eliminated TrajectoryModel::Eliminate(std::size_t f,
                                                       Eigen::MatrixXd& normal,
                                                       Eigen::VectorXd& rhs) const {
  const Eigen::Index r = rank_;
  const Eigen::Index n = 3 * (r + 1);
  const Feature& feature = features_[f];
  const Normal own = NormalOf(f, true);
  Eliminated e;
  e.extended.resize(r + 1);
  e.extended << 1.0, feature.mean.head(r);
  e.of_anchor = own.of_anchor;
  e.covariance = own.information.llt().solve(Matrix::Identity(r + 2, r + 2));
  e.step = e.covariance * own.gradient;
  const Matrix zz = e.extended * e.extended.transpose();
  const auto add = [&](Eigen::Index k, Eigen::Index l, const Eigen::Matrix3d& block) {
    for (Eigen::Index p = 0; p <= r; ++p) {
      for (Eigen::Index q = 0; q <= r; ++q) {
        normal.block<3, 3>(n * k + 3 * p, n * l + 3 * q) += zz(p, q) * block;
      }
    }
  };
  for (Eigen::Index l = 0; n * l < rhs.size(); ++l) {
    const Frame& frame = frames_[static_cast<std::size_t>(l)];
    const Observation& o = frame.observations[f];
    if (!Seen(o)) continue;
    const Projection at = Project(frame.camera, feature.mean);
    const Eigen::Vector2d d = Residual(at, o, feature);
    const Eigen::Matrix<double, 3, 2> HW =
        at.of_homogeneous.transpose() * Weight(o, d, true, frame.misfit);
    Eliminated::Coupling& c = e.couplings.emplace_back();
    c.frame = l;
    c.block.setZero(3, r + 2);
    c.block.leftCols(r) = HW * at.of_z;
    if (!o.anchor) c.block.rightCols(2) = HW;
    add(l, l, HW * at.of_homogeneous);
    const Eigen::Vector3d g = HW * d - c.block * e.step;
    for (Eigen::Index p = 0; p <= r; ++p) rhs.segment<3>(n * l + 3 * p) += e.extended[p] * g;
  }
  for (std::size_t i = 0; i < e.couplings.size(); ++i) {
    const auto with_feature = (e.couplings[i].block * e.covariance).eval();
    for (std::size_t j = 0; j <= i; ++j) {
      add(e.couplings[i].frame,
          e.couplings[j].frame,
          -with_feature * e.couplings[j].block.transpose());
    }
  }
  return e;
}

// One step of Levenberg and Marquardt of the newest cameras and all features together: where the
// camera moves ahead, alternation alone needs hundreds.
void TrajectoryModel::StepJointly() {
  constexpr int kTrials = 5;
  constexpr double kLeastDamping = 1e-6;
  const Eigen::Index n = 3 * (rank_ + 1);
  const std::size_t N = std::min(kJointFrames, frames_.size());
  for (Frame& frame : frames_) UpdateMisfit(frame);

  Eigen::MatrixXd normal =
      Eigen::MatrixXd::Zero(n * static_cast<Eigen::Index>(N), n * static_cast<Eigen::Index>(N));
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(normal.rows());
  std::vector<Eliminated> eliminated;
  double cost = 0.0;
  for (std::size_t f = 0; f < features_.size(); ++f) {
    eliminated.push_back(Eliminate(f, normal, rhs));
    cost += Cost(f, eliminated[f].of_anchor, true);
  }
  std::vector<Camera> cameras;
  for (std::size_t l = 0; l < N; ++l) {
    Fix(normal.block(n * static_cast<Eigen::Index>(l), n * static_cast<Eigen::Index>(l), n, n));
    cameras.push_back(frames_[l].camera);
  }
  const std::vector<Feature> features = features_;
  for (int trial = 0; trial < kTrials; ++trial) {
    Eigen::MatrixXd damped = normal;
    damped.diagonal() *= 1.0 + damping_;
    const Eigen::VectorXd solution = damped.selfadjointView<Eigen::Lower>().ldlt().solve(rhs);
    const auto step = [&](Eigen::Index l) {
      return solution.segment(n * l, n).reshaped(3, rank_ + 1);
    };
    for (std::size_t l = 0; l < N; ++l) {
      frames_[l].camera = cameras[l] + step(static_cast<Eigen::Index>(l));
    }
    double now = 0.0;
    for (std::size_t f = 0; f < features_.size(); ++f) {
      const Eliminated& e = eliminated[f];
      Vector of_cameras = Vector::Zero(rank_ + 2);
      for (const Eliminated::Coupling& c : e.couplings) {
        of_cameras += c.block.transpose() * (step(c.frame) * e.extended);
      }
      features_[f].mean = features[f].mean + e.step - e.covariance * of_cameras;
      now += Cost(f, e.of_anchor, true);
    }
    if (now <= cost) {
      damping_ = std::max(0.1 * damping_, kLeastDamping);
      return;
    }
    damping_ *= 10.0;
  }
  damping_ = kFirstDamping;
  features_ = features;
  for (std::size_t l = 0; l < N; ++l) frames_[l].camera = cameras[l];
}

void TrajectoryModel::UpdateMisfit(Frame& frame) const {
  std::vector<double> squares;
  for (std::size_t f = 0; f < features_.size(); ++f) {
    const Observation& o = frame.observations[f];
    if (!Seen(o) || o.anchor) continue;
    const Eigen::Vector2d d = Residual(Project(frame.camera, features_[f].mean), o, features_[f]);
    squares.push_back(d.dot(o.information * d));
  }
  frame.misfit = std::max(1.0, Median(std::move(squares)) / kMedianChiSquare);
}

// The expected normal equations: the coordinates count with their covariance.
void TrajectoryModel::RefitCamera(Frame& frame) const {
  const Eigen::Index r = rank_;
  const Eigen::Index n = 3 * (r + 1);
  UpdateMisfit(frame);
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
  Eigen::VectorXd rhs = Eigen::VectorXd::Zero(n);
  for (std::size_t f = 0; f < features_.size(); ++f) {
    const Observation& o = frame.observations[f];
    if (!Seen(o)) continue;
    const Feature& feature = features_[f];
    const Projection at = Project(frame.camera, feature.mean);
    const Eigen::Vector2d d = Residual(at, o, feature);
    const Eigen::Matrix2d W = Weight(o, d, true, frame.misfit);
    Vector z(r + 1);
    z << 1.0, feature.mean.head(r);
    Matrix zz = z * z.transpose();
    zz.bottomRightCorner(r, r) += feature.covariance.topLeftCorner(r, r);
    const Eigen::Matrix<double, 3, 2> HW = at.of_homogeneous.transpose() * W;
    const Eigen::Matrix3d HWH = HW * at.of_homogeneous;
    const Eigen::Vector3d HWd = HW * d;
    // Of z with the residual.
    Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxDimensions> with =
        at.of_z * feature.covariance.topLeftCorner(r, r);
    if (!o.anchor) with += feature.covariance.bottomLeftCorner(2, r);
    for (Eigen::Index p = 0; p <= r; ++p) {
      rhs.segment<3>(3 * p) += z[p] * HWd;
      if (p > 0) rhs.segment<3>(3 * p) -= HW * with.col(p - 1);
      for (Eigen::Index q = 0; q <= p; ++q) normal.block<3, 3>(3 * p, 3 * q) += zz(p, q) * HWH;
    }
  }
  normal = Eigen::MatrixXd(normal.selfadjointView<Eigen::Lower>());
  normal.diagonal().array() += 1e-9 * normal.trace() + 1e-300;
  Fix(normal);
  frame.camera.reshaped() += normal.ldlt().solve(rhs);
}

// Perspective leaves open which plane is at infinity: so that it keeps away from the features, the
// depths 1 + c'z are 1 in the mean of the frames. [1 z] -> [1 + d'z, z], a small step every frame.
void TrajectoryModel::CenterDepths() {
  constexpr double kLeastChange = 0.5;
  const Eigen::Index r = rank_;
  Vector d = Vector::Zero(r);
  for (const Frame& frame : frames_) {
    d += frame.camera.row(2).tail(r).transpose() / static_cast<double>(frames_.size());
  }
  double least = 0.0;  // of d'z
  for (const Feature& f : features_) least = std::min(least, d.dot(f.mean.head(r)));
  if (least < kLeastChange - 1.0) d *= (kLeastChange - 1.0) / least;
  for (Frame& frame : frames_) {
    frame.camera.rightCols(r) -= frame.camera.col(0) * d.transpose();
  }
  for (Feature& f : features_) {
    const double depth = 1.0 + d.dot(f.mean.head(r));
    f.mean.head(r) /= depth;
    const Matrix J = (Matrix::Identity(r, r) - f.mean.head(r) * d.transpose()) / depth;
    f.covariance.topLeftCorner(r, r) = J * f.covariance.topLeftCorner(r, r) * J.transpose();
    f.covariance.topRightCorner(r, 2) = J * f.covariance.topRightCorner(r, 2);
    f.covariance.bottomLeftCorner(2, r) = f.covariance.topRightCorner(r, 2).transpose();
  }
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
    frame.camera.col(0) += frame.camera.rightCols(r) * mean;
    frame.camera.rightCols(r) *= root;
    frame.camera /= frame.camera(2, 0);
  }
  for (Feature& f : features_) {
    f.mean.head(r) = inverse * (f.mean.head(r) - mean);
    f.covariance.topLeftCorner(r, r) =
        inverse * f.covariance.topLeftCorner(r, r) * inverse.transpose();
    f.covariance.topRightCorner(r, 2) = inverse * f.covariance.topRightCorner(r, 2);
    f.covariance.bottomLeftCorner(2, r) = f.covariance.topRightCorner(r, 2).transpose();
  }
}

// A cell of the table of residuals, each over its deviation.
struct TrajectoryModel::Cell {
  std::size_t frame = 0;
  std::size_t feature = 0;
  Eigen::Vector2d residual;
  Eigen::Matrix<double, 2, 3> of_homogeneous;
};

// One more coordinate v of the features, and the column g of every camera that goes with it: by
// alternating least squares they explain as much of the residuals as they can,
//   residual_lf = of_homogeneous_lf g_l v_f.
struct TrajectoryModel::Direction {
  Eigen::VectorXd v;
  Eigen::Matrix3Xd g;
  double explained = 0.0;  // sum of squares
};

TrajectoryModel::Direction TrajectoryModel::Explain(std::span<const Cell> cells,
                                                    Eigen::VectorXd v) const {
  constexpr int kIterations = 10;
  const auto N = static_cast<Eigen::Index>(frames_.size());
  Direction direction{std::move(v), Eigen::Matrix3Xd::Zero(3, N)};
  for (int i = 0; i < kIterations; ++i) {
    std::vector<Eigen::Matrix3d> normals(frames_.size(), 1e-12 * Eigen::Matrix3d::Identity());
    Eigen::Matrix3Xd rhs = Eigen::Matrix3Xd::Zero(3, N);
    for (const Cell& c : cells) {
      const double of_v = direction.v[static_cast<Eigen::Index>(c.feature)];
      const Eigen::Matrix<double, 2, 3> J = of_v * c.of_homogeneous;
      normals[c.frame] += J.transpose() * J;
      rhs.col(static_cast<Eigen::Index>(c.frame)) += J.transpose() * c.residual;
    }
    direction.explained = 0.0;
    for (Eigen::Index l = 0; l < N; ++l) {
      Eigen::Matrix3d& normal = normals[static_cast<std::size_t>(l)];
      if (!perspective_) normal(2, 2) += 1e6 * normal.trace();
      direction.g.col(l) = normal.ldlt().solve(rhs.col(l));
      direction.explained += direction.g.col(l).dot(rhs.col(l));
    }
    Eigen::VectorXd numerator = Eigen::VectorXd::Zero(direction.v.size());
    Eigen::VectorXd denominator = Eigen::VectorXd::Constant(direction.v.size(), 1e-12);
    for (const Cell& c : cells) {
      const auto f = static_cast<Eigen::Index>(c.feature);
      const Eigen::Vector2d J =
          c.of_homogeneous * direction.g.col(static_cast<Eigen::Index>(c.frame));
      numerator[f] += J.dot(c.residual);
      denominator[f] += J.squaredNorm();
    }
    direction.v = numerator.cwiseQuotient(denominator);
    direction.v *= std::sqrt(static_cast<double>(direction.v.size())) / direction.v.norm();
  }
  return direction;
}

// Besides the frame of its anchor.
std::size_t TrajectoryModel::TimesSeen(std::size_t f) const {
  return static_cast<std::size_t>(
      std::count_if(frames_.begin(), frames_.end(), [f](const Frame& frame) {
        const Observation& o = frame.observations[f];
        return Seen(o) && !o.anchor;
      }));
}

// Where the residuals have a direction in common, stronger than white noise would, the model gets
// one more coordinate. The search starts at the strongest affine direction (sideways motion,
// another body), and at the one that moves features towards and away from their centre (motion
// ahead).
void TrajectoryModel::AdaptRank() {
  // Of the edge of white noise, which itself reaches 0.6: the fit has taken a part of it out. A
  // rigid scene has three dimensions; for more the evidence must be stronger, and from features
  // that are no newcomers, since what comes to cover the scene looks like one more body too.
  const double least_strength = rank_ < 3 ? 0.5 : 1.0;
  constexpr std::size_t kLeastCells = 20;
  constexpr Eigen::Index kFeaturesPerRank = 2;
  const Eigen::Index r = rank_;
  const auto F = static_cast<Eigen::Index>(features_.size());
  const auto N = static_cast<Eigen::Index>(frames_.size());
  if (rank_ >= max_rank_ || kFeaturesPerRank * (r + 1) > F) return;
  std::vector<Cell> cells;
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(2 * N, F);
  Eigen::VectorXd radial = Eigen::VectorXd::Zero(F);
  double total = 0.0;
  std::vector<std::uint8_t> counts(features_.size(), 1);
  if (rank_ >= 3) {
    const std::size_t least = std::min(kEstablished, frames_.size() - 2);  // one miss of a few
    for (std::size_t f = 0; f < features_.size(); ++f) counts[f] = TimesSeen(f) >= least;
  }
  for (std::size_t l = 0; l < frames_.size(); ++l) {
    const Frame& frame = frames_[l];
    const Eigen::Vector2d center = frame.camera.topLeftCorner<2, 1>();
    for (std::size_t f = 0; f < features_.size(); ++f) {
      const Observation& o = frame.observations[f];
      if (counts[f] == 0 || !Seen(o) || o.anchor) continue;
      const Projection at = Project(frame.camera, features_[f].mean);
      const Eigen::Vector2d d = Residual(at, o, features_[f]);
      const double weight = std::sqrt(StudentWeight(d.dot(o.information * d)));
      const Eigen::Matrix2d root = weight * Eigen::Matrix2d(o.information.llt().matrixU());
      cells.push_back({l, f, root * d, root * at.of_homogeneous});
      R.block<2, 1>(2 * static_cast<Eigen::Index>(l), static_cast<Eigen::Index>(f)) = root * d;
      radial[static_cast<Eigen::Index>(f)] +=
          d.dot(at.xy - center) / ((at.xy - center).squaredNorm() + 1.0);
      total += cells.back().residual.squaredNorm();
    }
  }
  if (cells.size() < kLeastCells) return;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(R * R.transpose());
  Direction direction = Explain(cells, R.transpose() * eigen.eigenvectors().col(2 * N - 1));
  if (perspective_) {
    Direction ahead = Explain(cells, radial);
    if (ahead.explained > direction.explained) direction = std::move(ahead);
  }
  // Over the noise that is there, should it be more than the measurements state.
  const double variance = std::max(1.0, total / (2.0 * static_cast<double>(cells.size())));
  const double columns = perspective_ ? 3.0 : 2.0;
  const double edge =
      std::pow(std::sqrt(static_cast<double>(F)) + std::sqrt(columns * static_cast<double>(N)), 2);
  if (direction.explained < least_strength * edge * variance) return;
  rank_ = static_cast<int>(r) + 1;
  for (Eigen::Index l = 0; l < N; ++l) {
    Camera& camera = frames_[static_cast<std::size_t>(l)].camera;
    camera.conservativeResize(3, r + 2);
    camera.col(r + 1) = direction.g.col(l);
  }
  for (Eigen::Index f = 0; f < F; ++f) {
    Feature& feature = features_[static_cast<std::size_t>(f)];
    Vector mean(r + 3);
    mean << feature.mean.head(r), direction.v[f], feature.mean.tail<2>();
    Matrix covariance = Matrix::Zero(r + 3, r + 3);
    covariance.topLeftCorner(r, r) = feature.covariance.topLeftCorner(r, r);
    covariance.bottomRightCorner<2, 2>() = feature.covariance.bottomRightCorner<2, 2>();
    covariance.block(0, r + 1, r, 2) = feature.covariance.topRightCorner(r, 2);
    covariance.block(r + 1, 0, 2, r) = feature.covariance.bottomLeftCorner(2, r);
    covariance(r, r) = 0.1;
    feature.mean = mean;
    feature.covariance = covariance;
  }
  for (Frame& frame : frames_) RefitCamera(frame);
  for (std::size_t f = 0; f < features_.size(); ++f) InferFeature(f);
}

std::vector<TrajectoryModel::Estimate> TrajectoryModel::Update(std::span<const Observation> now) {
  Check(now.size() == features_.size(), "the model has the tracker's features");
  const bool fits = CanFit(now);
  Frame frame{{now.begin(), now.end()}, Camera::Zero(3, rank_ + 1)};
  if (fits) {
    frame.camera = FitCamera(now).camera;
  } else if (!frames_.empty()) {
    frame.camera = frames_.front().camera;
  }
  frames_.push_front(std::move(frame));
  if (frames_.size() > max_frames_) frames_.pop_back();
  if (rank_ == 0) return {};
  for (std::size_t f = 0; f < features_.size(); ++f) InferFeature(f);
  if (!fits) return {};
  // What is new takes more passes; later every frame goes on from the last.
  const int passes = frames_.size() < 8 ? 6 : 2;
  for (int pass = 0; pass < passes; ++pass) {
    StepJointly();
    for (std::size_t l = kJointFrames; l < frames_.size(); ++l) RefitCamera(frames_[l]);
    for (std::size_t f = 0; f < features_.size(); ++f) InferFeature(f);
    if (perspective_) CenterDepths();
    Normalize();
  }
  AdaptRank();
  Fit fit = FitCamera(frames_.front().observations);
  fit.camera = frames_.front().camera;
  return All(fit);
}

double TrajectoryModel::Misfit(std::size_t feature) const {
  constexpr double kPrior = 6.0;  // degrees of freedom
  if (rank_ == 0) return 1.0;
  double chi_square = kPrior;
  double freedom = -static_cast<double>(rank_);
  for (const Frame& frame : frames_) {
    const Observation& o = frame.observations[feature];
    if (!Seen(o) || o.anchor) continue;
    const Eigen::Vector2d d =
        Residual(Project(frame.camera, features_[feature].mean), o, features_[feature]);
    chi_square += d.dot(o.information * d);
    freedom += 2.0;
  }
  return chi_square / (std::max(freedom, 0.0) + kPrior);
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

void TrajectoryModel::Add(std::span<const Observation> trajectory) {
  for (std::size_t l = 0; l < frames_.size(); ++l) {
    frames_[l].observations.push_back(l < trajectory.size() ? trajectory[l] : Observation{});
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
    frame.camera.setZero(3, 3);
    frame.camera.topRows<2>() << mean, Eigen::Matrix2d(S.llt().matrixL());
    frame.camera(2, 0) = 1.0;
  }
  for (std::size_t f = 0; f < features_.size(); ++f) InferFeature(f);
}

}  // namespace cohort
