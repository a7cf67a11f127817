#include "frontend/track/trajectory_model/camera_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <vector>

#include "frontend/core/statistics.h"
#include "frontend/track/trajectory_model/noise.h"

namespace cohort::trajectory_model {
namespace {

// Variances of the entries of vec(C) from one frame to the next.
Eigen::VectorXd InformationOfMotion(const State& state) {
  // Until so many frames tell how cameras move, next to nothing is said of it: a picture's width
  // for positions, a hundredth for depth, which is about 1.
  constexpr std::size_t kLeastSteps = 4;
  constexpr double kFirstStepPx = 1000.0;
  constexpr double kFirstStepOfDepth = 0.01;
  const auto& frames = state.frames;
  Camera steps = Camera::Zero(3, state.rank + 1);
  for (std::size_t l = 0; l + 1 < frames.size(); ++l) {
    steps += (frames[l].camera - frames[l + 1].camera).cwiseAbs2() /
             static_cast<double>(frames.size() - 1);
  }
  if (frames.size() <= kLeastSteps) {
    steps.topRows<2>().setConstant(kFirstStepPx * kFirstStepPx);
    steps.row(2).setConstant(kFirstStepOfDepth * kFirstStepOfDepth);
  }
  return steps.cwiseMax(1e-8).cwiseInverse().reshaped();
}

// Normal equations of vec(C), C = camera, in the lower triangle.
struct CameraEquations {
  explicit CameraEquations(Eigen::Index n)
      : normal(Eigen::MatrixXd::Zero(n, n)), rhs(Eigen::VectorXd::Zero(n)) {}

  // [1 z] and the measurement's parts H' W H and H' W d, H = d xy / d (C [1 z]). As d xy / d vec(C)
  // = [1 z]' (x) H, the blocks are z_p z_q H' W H and z_p H' W d. `zz` is [1 z][1 z]' or its mean.
  void Add(const Vector& z,
           const Matrix& zz,
           const Eigen::Matrix3d& HWH,
           const Eigen::Vector3d& HWd) {
    for (Eigen::Index p = 0; p < z.size(); ++p) {
      rhs.segment<3>(3 * p) += z[p] * HWd;
      for (Eigen::Index q = 0; q <= p; ++q) normal.block<3, 3>(3 * p, 3 * q) += zz(p, q) * HWH;
    }
  }
  void FillUpperTriangle() { normal = Eigen::MatrixXd(normal.selfadjointView<Eigen::Lower>()); }

  Eigen::MatrixXd normal;
  Eigen::VectorXd rhs;
};

Vector Homogeneous(const Feature& feature, Eigen::Index r) {
  Vector z(r + 1);
  z << 1.0, feature.mean.head(r);
  return z;
}

}  // namespace

CameraFit FitNewCamera(const State& state, std::span<const Observation> now) {
  constexpr int kPasses = 6;
  const Eigen::Index r = state.rank;
  const Eigen::Index n = 3 * (r + 1);
  std::vector<std::size_t> observed;
  for (std::size_t f = 0; f < now.size(); ++f) {
    if (now[f].IsObserved()) observed.push_back(f);
  }
  const Camera before = state.frames.front().camera;
  const Eigen::VectorXd prior = InformationOfMotion(state);
  CameraFit fit;
  fit.camera = before;
  std::vector<double> weights(observed.size(), 1.0);
  for (int pass = 1;; ++pass) {
    CameraEquations equations(n);
    std::vector<double> squares;
    for (std::size_t i = 0; i < observed.size(); ++i) {
      const Feature& feature = state.features[observed[i]];
      const Observation& o = now[observed[i]];
      const Projection at = Project(fit.camera, feature.mean);
      Jacobian J(2, r + 2);
      J.leftCols(r) = at.of_z;
      J.rightCols(2) =
          o.anchor ? Eigen::Matrix2d::Zero().eval() : Eigen::Matrix2d::Identity().eval();
      const Eigen::Matrix2d S = o.information.inverse() + J * feature.covariance * J.transpose();
      const Eigen::Matrix2d information = S.inverse();
      const Eigen::Vector2d d = Residual(at, o, feature);
      squares.push_back(d.dot(information * d));
      const Eigen::Matrix<double, 3, 2> HW =
          weights[i] * at.of_homogeneous.transpose() * information;
      const Vector z = Homogeneous(feature, r);
      equations.Add(z, z * z.transpose(), HW * at.of_homogeneous, HW * d);
    }
    equations.FillUpperTriangle();
    equations.normal.diagonal() += prior;
    equations.rhs += prior.cwiseProduct((before - fit.camera).reshaped());
    FixCameraGauge(state.perspective, equations.normal);
    const Eigen::LDLT<Eigen::MatrixXd> solver(equations.normal);
    fit.camera.reshaped() += solver.solve(equations.rhs);
    if (pass == kPasses) {
      fit.covariance = solver.solve(Eigen::MatrixXd::Identity(n, n));
      return fit;
    }
    // Where all squares are larger than their noise says, none of them is more in doubt for it.
    const double scale = std::max(1.0, Median(squares) / kMedianChiSquare);
    for (std::size_t i = 0; i < observed.size(); ++i) {
      weights[i] = StudentWeight(squares[i] / scale);
    }
  }
}

void RefitCamera(const State& state, Frame& frame) {
  const Eigen::Index r = state.rank;
  frame.misfit = MisfitOfFrame(frame, state.features);
  CameraEquations equations(3 * (r + 1));
  for (std::size_t f = 0; f < state.features.size(); ++f) {
    const Observation& o = frame.observations[f];
    if (!o.IsObserved()) continue;
    const Feature& feature = state.features[f];
    const Projection at = Project(frame.camera, feature.mean);
    const Eigen::Vector2d d = Residual(at, o, feature);
    const Vector z = Homogeneous(feature, r);
    Matrix zz = z * z.transpose();
    zz.bottomRightCorner(r, r) += feature.covariance.topLeftCorner(r, r);
    const Eigen::Matrix<double, 3, 2> HW =
        at.of_homogeneous.transpose() * RobustInformation(o, d, frame.misfit);
    equations.Add(z, zz, HW * at.of_homogeneous, HW * d);
    // The residual at z + dz, e + de is d - (d xy / d z) dz - de: its mean product with dz.
    Jacobian with_z = at.of_z * feature.covariance.topLeftCorner(r, r);
    if (!o.anchor) with_z += feature.covariance.bottomLeftCorner(2, r);
    for (Eigen::Index p = 1; p <= r; ++p) {
      equations.rhs.segment<3>(3 * p) -= HW * with_z.col(p - 1);
    }
  }
  equations.FillUpperTriangle();
  equations.normal.diagonal().array() += 1e-9 * equations.normal.trace() + 1e-300;
  FixCameraGauge(state.perspective, equations.normal);
  frame.camera.reshaped() += equations.normal.ldlt().solve(equations.rhs);
}

}  // namespace cohort::trajectory_model
