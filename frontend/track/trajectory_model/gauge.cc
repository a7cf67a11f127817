#include "frontend/track/trajectory_model/gauge.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace cohort::trajectory_model {
namespace {

// The covariance of (z, e) if z moves by A dz.
void MapCoordinates(const Matrix& A, FeaturePosterior& feature) {
  const Eigen::Index r = A.rows();
  Matrix& covariance = feature.covariance;
  covariance.topLeftCorner(r, r) = A * covariance.topLeftCorner(r, r) * A.transpose();
  covariance.topRightCorner(r, 2) = A * covariance.topRightCorner(r, 2);
  covariance.bottomLeftCorner(2, r) = covariance.topRightCorner(r, 2).transpose();
}

}  // namespace

void CenterDepths(State& state) {
  constexpr double kLeastChange = 0.5;  // of any depth, by one call
  const Eigen::Index r = state.rank;
  Vector d = Vector::Zero(r);
  for (const Frame& frame : state.frames) {
    d += frame.camera.row(2).tail(r).transpose() / static_cast<double>(state.frames.size());
  }
  double least = 0.0;  // of d'z
  for (const FeaturePosterior& f : state.features) least = std::min(least, d.dot(f.mean.head(r)));
  if (least < kLeastChange - 1.0) d *= (kLeastChange - 1.0) / least;
  for (Frame& frame : state.frames) {
    frame.camera.rightCols(r) -= frame.camera.col(0) * d.transpose();
  }
  for (FeaturePosterior& f : state.features) {
    const double depth = 1.0 + d.dot(f.mean.head(r));
    f.mean.head(r) /= depth;
    // The derivative of z' = z / (1 + d'z) by z: (I - z' d') / (1 + d'z).
    MapCoordinates((Matrix::Identity(r, r) - f.mean.head(r) * d.transpose()) / depth, f);
  }
}

void NormalizeCoordinates(State& state) {
  const Eigen::Index r = state.rank;
  const double count = static_cast<double>(state.features.size());
  Vector mean = Vector::Zero(r);
  for (const FeaturePosterior& f : state.features) mean += f.mean.head(r) / count;
  Matrix scatter = Matrix::Zero(r, r);
  for (const FeaturePosterior& f : state.features) {
    const Vector d = f.mean.head(r) - mean;
    scatter += (d * d.transpose() + f.covariance.topLeftCorner(r, r)) / count;
  }
  scatter.diagonal().array() += 1e-12;
  const Matrix root = scatter.llt().matrixL();
  const Matrix inverse = root.triangularView<Eigen::Lower>().solve(Matrix::Identity(r, r));
  for (Frame& frame : state.frames) {
    frame.camera.col(0) += frame.camera.rightCols(r) * mean;
    frame.camera.rightCols(r) *= root;
    frame.camera /= frame.camera(2, 0);
  }
  for (FeaturePosterior& f : state.features) {
    f.mean.head(r) = inverse * (f.mean.head(r) - mean);
    MapCoordinates(inverse, f);
  }
}

}  // namespace cohort::trajectory_model
