#include "frontend/track/trajectory_model/camera_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <vector>

#include "frontend/core/statistics.h"
#include "frontend/track/trajectory_model/noise.h"
#include "frontend/track/trajectory_model/sized.h"

namespace cohort::trajectory_model {
namespace {

// Inverse variances of the steps of the entries of vec(C) from one frame to the next.
Eigen::VectorXd InformationOfMotion(const State& state) {
  // With no more frames than this, the motion of the cameras is not known yet, and the prior is
  // weak: a picture's width for positions, a hundredth for depth, which is about 1.
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
template <int R>
struct CameraEquations {
  static constexpr int kMost = R == Eigen::Dynamic ? Eigen::Dynamic : 3 * (R + 1);

  explicit CameraEquations(Eigen::Index rank) {
    normal.setZero(3 * (rank + 1), 3 * (rank + 1));
    rhs.setZero(3 * (rank + 1));
  }

  // [1 z] and the measurement's parts H' W H and H' W d, H = d xy / d (C [1 z]). As d xy / d vec(C)
  // = [1 z]' (x) H, the blocks are z_p z_q H' W H and z_p H' W d. `zz` is [1 z][1 z]' or its mean.
  template <typename Homogeneous, typename Square>
  void Add(const Homogeneous& z,
           const Square& zz,
           const Eigen::Matrix3d& HWH,
           const Eigen::Vector3d& HWd) {
    for (Eigen::Index p = 0; p < z.size(); ++p) {
      rhs.template segment<3>(3 * p) += z[p] * HWd;
      for (Eigen::Index q = 0; q <= p; ++q) {
        normal.template block<3, 3>(3 * p, 3 * q) += zz(p, q) * HWH;
      }
    }
  }
  void FillUpperTriangle() {
    normal.template triangularView<Eigen::StrictlyUpper>() = normal.transpose();
  }

  Eigen::Matrix<double, kMost, kMost> normal;
  Eigen::Matrix<double, kMost, 1> rhs;
};

template <int R>
typename Sized<R>::Homogeneous HomogeneousOf(const FeaturePosterior& feature, Eigen::Index r) {
  typename Sized<R>::Homogeneous z(r + 1);
  z << 1.0, Sized<R>::MeanOf(feature).head(r);
  return z;
}

template <int R>
using HomogeneousSquare = Eigen::Matrix<double,
                                        Sized<R>::Plus(1),
                                        Sized<R>::Plus(1),
                                        0,
                                        Sized<R>::MostPlus(1),
                                        Sized<R>::MostPlus(1)>;

template <int R>
CameraFit FitSized(const State& state, std::span<const Observation> now) {
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
  // The noise of every measurement, which is the same in all passes.
  std::vector<Eigen::Matrix2d> noise;
  for (const std::size_t f : observed) noise.push_back(now[f].information.inverse());
  std::vector<double> weights(observed.size(), 1.0);
  std::vector<double> squares(observed.size());
  for (int pass = 1;; ++pass) {
    CameraEquations<R> equations(r);
    for (std::size_t i = 0; i < observed.size(); ++i) {
      const FeaturePosterior& feature = state.features[observed[i]];
      const auto mean = Sized<R>::MeanOf(feature);
      const Observation& o = now[observed[i]];
      const auto at = ProjectSized<R>(Sized<R>::Of(fit.camera), mean);
      const Eigen::Matrix2d S =
          noise[i] + CovarianceOfPosition<R>(at.of_z, Sized<R>::CovarianceOf(feature), !o.anchor);
      const Eigen::Matrix2d information = S.inverse();
      const Eigen::Vector2d d = SizedResidual<R>(at, o, mean);
      squares[i] = d.dot(information * d);
      const Eigen::Matrix<double, 2, 3> H = at.OfHomogeneous();
      const Eigen::Matrix<double, 3, 2> HW = weights[i] * H.transpose() * information;
      const auto z = HomogeneousOf<R>(feature, r);
      const HomogeneousSquare<R> zz = z.lazyProduct(z.transpose());
      equations.Add(z, zz, HW * H, HW * d);
    }
    equations.FillUpperTriangle();
    equations.normal.diagonal() += prior;
    equations.rhs += prior.cwiseProduct((before - fit.camera).reshaped());
    FixCameraGauge(state.perspective, equations.normal);
    const Eigen::LDLT<decltype(equations.normal)> solver(equations.normal);
    fit.camera.reshaped() += solver.solve(equations.rhs);
    if (pass == kPasses) {
      fit.covariance = solver.solve(Eigen::MatrixXd::Identity(n, n));
      return fit;
    }
    // If all squares exceed what their noise explains, no single one should lose weight for it.
    const double scale = std::max(1.0, Median(squares) / kMedianChiSquare2);
    for (std::size_t i = 0; i < observed.size(); ++i) {
      weights[i] = StudentWeight(squares[i] / scale);
    }
  }
}

template <int R>
void RefitSized(const State& state, Frame& frame) {
  const Eigen::Index r = state.rank;
  CameraEquations<R> equations(r);
  for (std::size_t f = 0; f < state.features.size(); ++f) {
    const Observation& o = frame.observations[f];
    if (!o.IsObserved()) continue;
    const FeaturePosterior& feature = state.features[f];
    const auto mean = Sized<R>::MeanOf(feature);
    const auto covariance = Sized<R>::CovarianceOf(feature);
    const auto at = ProjectSized<R>(Sized<R>::Of(frame.camera), mean);
    const Eigen::Vector2d d = SizedResidual<R>(at, o, mean);
    const auto z = HomogeneousOf<R>(feature, r);
    HomogeneousSquare<R> zz = z.lazyProduct(z.transpose());
    zz.bottomRightCorner(r, r) += covariance.topLeftCorner(r, r);
    const Eigen::Matrix<double, 2, 3> H = at.OfHomogeneous();
    const Eigen::Matrix<double, 3, 2> HW = H.transpose() * RobustInformation(o, d, frame.misfit);
    equations.Add(z, zz, HW * H, HW * d);
    // The residual at z + dz, e + de is d - (d xy / d z) dz - de: its mean product with dz.
    typename Sized<R>::OfZ with_z = at.of_z.lazyProduct(covariance.topLeftCorner(r, r));
    if (!o.anchor) with_z += covariance.bottomLeftCorner(2, r);
    for (Eigen::Index p = 1; p <= r; ++p) {
      equations.rhs.template segment<3>(3 * p) -= HW * with_z.col(p - 1);
    }
  }
  equations.FillUpperTriangle();
  equations.normal.diagonal().array() += 1e-9 * equations.normal.trace() + 1e-300;
  FixCameraGauge(state.perspective, equations.normal);
  frame.camera.reshaped() += equations.normal.ldlt().solve(equations.rhs);
}

}  // namespace

CameraFit FitNewCamera(const State& state, std::span<const Observation> now) {
  return WithRank(state.rank, [&](auto rank) { return FitSized<rank.value>(state, now); });
}

void RefitCamera(const State& state, Frame& frame) {
  frame.misfit = MisfitOfFrame(frame, state.features);
  WithRank(state.rank, [&](auto rank) { RefitSized<rank.value>(state, frame); });
}

}  // namespace cohort::trajectory_model
