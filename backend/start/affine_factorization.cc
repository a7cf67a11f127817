#include "backend/start/affine_factorization.h"

#include <Eigen/Cholesky>
#include <Eigen/Dense>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr int kMinFrames = 3;
constexpr int kMinCompleteTracks = 8;
constexpr int kAlternations = 60;
// Least effect of the third dimension on the image, normalised units (0.05 px at f = 500 px).
constexpr double kMinThirdDimension = 1e-4;

struct AffineFit {
  std::vector<Eigen::Matrix<double, 2, 3>> A;     // per frame
  std::vector<Eigen::Vector2d> b;                 // per frame
  std::vector<std::optional<Eigen::Vector3d>> S;  // per track
};

// Rank-3 SVD of the complete tracks.
std::optional<AffineFit> StartFromCompleteTracks(int frames,
                                                 int tracks,
                                                 std::span<const AffineMeasurement> measurements) {
  std::vector<int> length(tracks, 0);
  for (const AffineMeasurement& m : measurements) ++length[m.track];
  std::vector<int> column(tracks, -1);
  int complete = 0;
  for (int t = 0; t < tracks; ++t) {
    if (length[t] == frames) column[t] = complete++;
  }
  if (complete < kMinCompleteTracks) return std::nullopt;
  Eigen::MatrixXd W(2 * frames, complete);
  for (const AffineMeasurement& m : measurements) {
    if (column[m.track] >= 0) W.block<2, 1>(2 * m.frame, column[m.track]) = m.n;
  }
  AffineFit fit;
  fit.A.resize(frames);
  fit.b.resize(frames);
  fit.S.resize(tracks);
  for (int f = 0; f < frames; ++f) {
    // The median is the origin that wrong tracks move least.
    for (int k = 0; k < 2; ++k) {
      auto row = W.row(2 * f + k);
      fit.b[f][k] = Median({row.begin(), row.end()});
      row.array() -= fit.b[f][k];
    }
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> gram(W * W.transpose());
  if (2 * frames < 3) return std::nullopt;
  const Eigen::MatrixXd U = gram.eigenvectors().rightCols<3>();
  for (int f = 0; f < frames; ++f) fit.A[f] = U.middleRows<2>(2 * f);
  for (int t = 0; t < tracks; ++t) {
    if (column[t] >= 0) fit.S[t] = U.transpose() * W.col(column[t]);
  }
  return fit;
}

// Alternates points and cameras, each a small weighted least-squares problem.
class Alternation {
 public:
  Alternation(std::span<const AffineMeasurement> measurements, AffineFit fit)
      : measurements_(measurements), fit_(std::move(fit)) {
    by_track_.resize(fit_.S.size());
    by_frame_.resize(fit_.A.size());
    for (const AffineMeasurement& m : measurements_) {
      by_track_[m.track].push_back(&m);
      by_frame_[m.frame].push_back(&m);
    }
  }

  AffineFit Run() {
    // The weights' scale comes down slowly from least squares': a scale that follows the median
    // at once can settle on a fit of half the measurements.
    scale_ = 5.0 * RobustError();
    for (int i = 0; i < kAlternations; ++i) {
      SolvePoints();
      SolveCameras();
      const double scale = std::max(RobustError(), 0.7 * scale_);
      const bool settled = std::abs(scale - scale_) <= 1e-3 * scale_;
      scale_ = scale;
      if (settled) break;
    }
    SolvePoints();
    scale_ = RobustError();
    return fit_;
  }
  double scale() const { return scale_; }

 private:
  Eigen::Vector2d Residual(const AffineMeasurement& m, const Eigen::Vector3d& s) const {
    return m.n - fit_.A[m.frame] * s - fit_.b[m.frame];
  }
  double Weight(const Eigen::Vector2d& residual) const {
    const double c = std::max(2.0 * scale_, 1e-12);
    return 1.0 / (1.0 + residual.squaredNorm() / (c * c));
  }
  double RobustError() const {
    std::vector<double> errors;
    errors.reserve(measurements_.size());
    for (const AffineMeasurement& m : measurements_) {
      if (fit_.S[m.track]) errors.push_back(Residual(m, *fit_.S[m.track]).norm());
    }
    return 1.4826 * Median(std::move(errors));
  }

  void SolvePoints() {
    for (std::size_t t = 0; t < fit_.S.size(); ++t) {
      if (by_track_[t].size() < 2) continue;
      // A new track starts with equal weights and is then weighted by its own fit.
      for (int pass = fit_.S[t] ? 1 : 0; pass < 2; ++pass) {
        Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
        Eigen::Vector3d g = Eigen::Vector3d::Zero();
        for (const AffineMeasurement* m : by_track_[t]) {
          const auto& A = fit_.A[m->frame];
          const double w = fit_.S[t] ? Weight(Residual(*m, *fit_.S[t])) : 1.0;
          H.noalias() += w * A.transpose() * A;
          g.noalias() += w * A.transpose() * (m->n - fit_.b[m->frame]);
        }
        // Frames too close to each other leave depth open: no point rather than a wild one.
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(H);
        if (eigen.eigenvalues()[0] < 1e-10 * eigen.eigenvalues()[2]) {
          fit_.S[t].reset();
          break;
        }
        fit_.S[t] = H.ldlt().solve(g);
      }
    }
  }

  void SolveCameras() {
    for (std::size_t f = 0; f < fit_.A.size(); ++f) {
      Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
      Eigen::Matrix<double, 4, 2> g = Eigen::Matrix<double, 4, 2>::Zero();
      for (const AffineMeasurement* m : by_frame_[f]) {
        if (!fit_.S[m->track]) continue;
        const Eigen::Vector4d s = fit_.S[m->track]->homogeneous();
        const double w = Weight(Residual(*m, *fit_.S[m->track]));
        H.noalias() += w * s * s.transpose();
        g.noalias() += w * s * m->n.transpose();
      }
      const Eigen::Matrix<double, 4, 2> x = H.ldlt().solve(g);
      if (!x.allFinite()) continue;
      fit_.A[f] = x.topRows<3>().transpose();
      fit_.b[f] = x.row(3).transpose();
    }
  }

  std::span<const AffineMeasurement> measurements_;
  AffineFit fit_;
  std::vector<std::vector<const AffineMeasurement*>> by_track_;
  std::vector<std::vector<const AffineMeasurement*>> by_frame_;
  double scale_ = 0.0;
};

// L with A_f L of two orthogonal rows of equal length in every frame: Q = L L^T is the null vector
// of i^T Q i - j^T Q j = 0, i^T Q j = 0, least squares over frames.
std::optional<Eigen::Matrix3d> MetricUpgrade(const std::vector<Eigen::Matrix<double, 2, 3>>& A) {
  using Row6 = Eigen::Matrix<double, 1, 6>;
  const auto row = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    Row6 r;
    r << a[0] * b[0], a[0] * b[1] + a[1] * b[0], a[0] * b[2] + a[2] * b[0], a[1] * b[1],
        a[1] * b[2] + a[2] * b[1], a[2] * b[2];
    return r;
  };
  Eigen::Matrix<double, 6, 6> gram = Eigen::Matrix<double, 6, 6>::Zero();
  for (const auto& a : A) {
    const double size = a.squaredNorm() / 2.0;
    if (!(size > 0.0)) return std::nullopt;
    const Eigen::Vector3d i = a.row(0).transpose();
    const Eigen::Vector3d j = a.row(1).transpose();
    const Row6 equal = (row(i, i) - row(j, j)) / size;
    const Row6 orthogonal = 2.0 * row(i, j) / size;
    gram += equal.transpose() * equal + orthogonal.transpose() * orthogonal;
  }
  const Eigen::Matrix<double, 6, 1> q =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(gram).eigenvectors().col(0);
  Eigen::Matrix3d Q;
  Q << q[0], q[1], q[2], q[1], q[3], q[4], q[2], q[4], q[5];
  if (Q.trace() < 0.0) Q = -Q;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(Q);
  Eigen::Vector3d values = eigen.eigenvalues();
  if (!(values[2] > 0.0) || values[1] < 1e-4 * values[2]) return std::nullopt;
  // Noise may push the smallest below 0; the bundle adjustment that follows repairs a poor start.
  values[0] = std::max(values[0], 1e-3 * values[2]);
  return eigen.eigenvectors() * values.cwiseSqrt().asDiagonal();
}

// A fit whose points have mean 0 and unit spread in all directions, so that the metric upgrade is
// well conditioned and a missing third dimension shows.
struct WhitenedFit {
  std::vector<Eigen::Matrix<double, 2, 3>> A;  // of points with unit spread, per frame
  Eigen::Matrix3d spread_root;                 // L: A = A_fit L, s = L^-1 s_fit
};

// Moves the points' mean to the origin. None: the points span no volume.
std::optional<WhitenedFit> CentreAndWhiten(AffineFit& fit) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  int points = 0;
  for (const auto& s : fit.S) {
    if (!s) continue;
    mean += *s;
    ++points;
  }
  if (points < kMinCompleteTracks) return std::nullopt;
  mean /= points;
  for (std::size_t f = 0; f < fit.A.size(); ++f) fit.b[f] += fit.A[f] * mean;
  Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
  for (auto& s : fit.S) {
    if (!s) continue;
    *s -= mean;
    spread += *s * s->transpose();
  }
  const Eigen::LLT<Eigen::Matrix3d> cholesky(spread / points);
  if (cholesky.info() != Eigen::Success) return std::nullopt;
  WhitenedFit whitened;
  whitened.spread_root = cholesky.matrixL();
  for (const auto& a : fit.A) whitened.A.push_back(a * whitened.spread_root);
  return whitened;
}

// Whether the third dimension moves the points by more than the fit's error: otherwise there is
// nothing to upgrade.
bool HasThirdDimension(const std::vector<Eigen::Matrix<double, 2, 3>>& A, double rms_error) {
  Eigen::Matrix3d motion = Eigen::Matrix3d::Zero();
  for (const auto& a : A) motion += a.transpose() * a;
  const Eigen::Vector3d singular =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(motion / static_cast<int>(A.size()))
          .eigenvalues()
          .cwiseMax(0.0);
  const double effect = std::sqrt(singular[0]);
  return !(effect <= 0.5 * rms_error || effect < kMinThirdDimension);
}

// The upgraded fit as perspective poses (R, (z b, z)), as it is or mirrored in depth. None: it is
// not finite.
std::optional<AffineModel> MetricModel(const WhitenedFit& whitened,
                                       const AffineFit& fit,
                                       const Eigen::Matrix3d& upgrade,
                                       const Eigen::Matrix3d& point_upgrade,
                                       bool mirrored) {
  const Eigen::Vector3d mirror(1.0, 1.0, -1.0);
  AffineModel model;
  for (std::size_t f = 0; f < whitened.A.size(); ++f) {
    Eigen::Matrix<double, 2, 3> rows = whitened.A[f] * upgrade;
    if (mirrored) rows = rows * mirror.asDiagonal();
    const Eigen::JacobiSVD<Eigen::Matrix<double, 2, 3>> svd(
        rows, Eigen::ComputeFullU | Eigen::ComputeFullV);
    if (svd.info() != Eigen::Success) return std::nullopt;  // not finite
    const Eigen::Matrix<double, 2, 3> orthonormal =
        svd.matrixU() * svd.matrixV().leftCols<2>().transpose();
    const double depth = 2.0 / svd.singularValues().sum();
    Eigen::Matrix3d rotation;
    rotation.topRows<2>() = orthonormal;
    rotation.row(2) = orthonormal.row(0).cross(orthonormal.row(1));
    model.cam_from_world.push_back(
        {Eigen::Quaterniond(rotation).normalized(), depth * fit.b[f].homogeneous()});
  }
  for (const auto& s : fit.S) {
    if (!s) {
      model.points_in_world.emplace_back();
      continue;
    }
    Eigen::Vector3d x = point_upgrade * *s;
    if (mirrored) x = mirror.asDiagonal() * x;
    model.points_in_world.emplace_back(x);
  }
  return model;
}

}  // namespace

std::optional<AffineFactorization> FactorizeAffine(
    int frames, int tracks, std::span<const AffineMeasurement> measurements) {
  if (frames < kMinFrames) return std::nullopt;
  std::optional<AffineFit> start = StartFromCompleteTracks(frames, tracks, measurements);
  if (!start) return std::nullopt;
  Alternation alternation(measurements, std::move(*start));
  AffineFit fit = alternation.Run();
  const std::optional<WhitenedFit> whitened = CentreAndWhiten(fit);
  if (!whitened || !HasThirdDimension(whitened->A, alternation.scale())) return std::nullopt;
  const std::optional<Eigen::Matrix3d> upgrade = MetricUpgrade(whitened->A);
  if (!upgrade) return std::nullopt;
  const Eigen::Matrix3d point_upgrade = (whitened->spread_root * *upgrade).inverse();
  if (!point_upgrade.allFinite()) return std::nullopt;

  AffineFactorization result;
  result.rms_error = alternation.scale();
  for (const bool mirrored : {false, true}) {
    auto model = MetricModel(*whitened, fit, *upgrade, point_upgrade, mirrored);
    if (!model) return std::nullopt;
    result.mirror_models[mirrored ? 1 : 0] = std::move(*model);
  }
  return result;
}

}  // namespace cohort
