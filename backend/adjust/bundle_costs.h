#pragma once

// The cost functions that Ceres minimises in a bundle adjustment. Used only by
// bundle_adjustment.cc.

#include <ceres/ceres.h>

#include <array>
#include <cmath>

#include "backend/scene/reprojection.h"

namespace cohort {

using RowMajor27 = Eigen::Matrix<double, 2, 7, Eigen::RowMajor>;
using RowMajor23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using RowMajor26 = Eigen::Matrix<double, 2, 6, Eigen::RowMajor>;

inline constexpr int kPoseSize = 7;  // quaternion x, y, z, w; centre
inline constexpr int kIntrinsicSize = 5;
// The parameters that all cameras share, the intrinsics or the shift, padded to the six dimensions
// of a pose. If all blocks have one size, which is then known at compile time, Ceres eliminates the
// points several times as fast.
inline constexpr int kSharedSize = 6;
using SharedVector = Eigen::Matrix<double, kSharedSize, 1>;

inline CameraPose ReadPose(const double* pose) {
  return {Eigen::Quaterniond(pose), Eigen::Vector3d(pose + 4)};
}

// Cost functions write derivatives with respect to the pose's 6-vector into the first six of the
// seven columns. This manifold's Jacobian [I_6; 0] passes them on, which saves the chain rule
// through the quaternion.
class PoseManifold final : public ceres::Manifold {
 public:
  int AmbientSize() const override { return kPoseSize; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    const Eigen::Vector3d omega(delta);
    const double angle = omega.norm();
    Eigen::Quaterniond step;
    step.w() = std::cos(angle / 2.0);
    step.vec() = angle > 1e-12 ? Eigen::Vector3d(std::sin(angle / 2.0) / angle * omega)
                               : Eigen::Vector3d(omega / 2.0);
    Eigen::Map<Eigen::Quaterniond> rotation(x_plus_delta);
    rotation = (step * Eigen::Quaterniond(x)).normalized();
    for (int i = 0; i < 3; ++i) x_plus_delta[4 + i] = x[4 + i] + delta[3 + i];
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, kPoseSize, 6, Eigen::RowMajor>> j(jacobian);
    j.setIdentity();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    const Eigen::AngleAxisd step(Eigen::Quaterniond(y) * Eigen::Quaterniond(x).conjugate());
    Eigen::Map<Eigen::Vector3d> omega(y_minus_x);
    omega = step.angle() * step.axis();
    for (int i = 0; i < 3; ++i) y_minus_x[3 + i] = y[4 + i] - x[4 + i];
    return true;
  }
  bool MinusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, 6, kPoseSize, Eigen::RowMajor>> j(jacobian);
    j.setIdentity();
    return true;
  }
};

// Moves only the `free` parameters. It keeps six dimensions, see kSharedSize: the other columns of
// the Jacobian are 0, and so are their steps.
class SharedManifold final : public ceres::Manifold {
 public:
  explicit SharedManifold(const std::array<bool, kSharedSize>& free) {
    for (int i = 0; i < kSharedSize; ++i) free_[i] = free[i] ? 1.0 : 0.0;
  }
  int AmbientSize() const override { return kSharedSize; }
  int TangentSize() const override { return kSharedSize; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override {
    for (int i = 0; i < kSharedSize; ++i) x_plus_delta[i] = x[i] + free_[i] * delta[i];
    return true;
  }
  bool PlusJacobian(const double*, double* jacobian) const override {
    Eigen::Map<Eigen::Matrix<double, kSharedSize, kSharedSize>> j(jacobian);
    j = free_.asDiagonal();
    return true;
  }
  bool Minus(const double* y, const double* x, double* y_minus_x) const override {
    for (int i = 0; i < kSharedSize; ++i) y_minus_x[i] = free_[i] * (y[i] - x[i]);
    return true;
  }
  bool MinusJacobian(const double* x, double* jacobian) const override {
    return PlusJacobian(x, jacobian);
  }

 private:
  SharedVector free_ = SharedVector::Zero();
};

// Writes those derivatives of a residual with respect to the pose (block 0) and the point (block 1)
// that Ceres asks for; `d_n`: the derivative with respect to the normalised image point.
inline void WriteSceneDerivatives(const NormalisedProjection& p,
                                  const Eigen::Matrix2d& d_n,
                                  double** jacobians) {
  if (jacobians[0] != nullptr) {
    Eigen::Map<RowMajor27> d_pose(jacobians[0]);
    d_pose.leftCols<6>() = d_n * p.d_pose;
    d_pose.col(6).setZero();
  }
  if (jacobians[1] != nullptr) {
    Eigen::Map<RowMajor23> d_point(jacobians[1]);
    d_point = d_n * p.d_point;
  }
}

// Known intrinsics: the observation is unprojected once to n. In the residual W (n(x) - n), W
// combines the pixel covariance and the camera's derivative at n.
class CalibratedCost final : public ceres::SizedCostFunction<2, kPoseSize, 3> {
 public:
  CalibratedCost(const Eigen::Vector2d& n, const Eigen::Matrix2d& whitening)
      : n_(n), whitening_(whitening) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const NormalisedProjection p =
        ProjectNormalised(ReadPose(parameters[0]), Eigen::Vector3d(parameters[1]));
    Eigen::Map<Eigen::Vector2d> residual(residuals);
    residual = whitening_ * (p.n - n_);
    if (jacobians == nullptr) return true;
    WriteSceneDerivatives(p, whitening_, jacobians);
    return true;
  }

 private:
  Eigen::Vector2d n_;
  Eigen::Matrix2d whitening_;
};

// The same for an observation that moves with a shared unknown: W (n(x) - n - shift d_shift).
class ShiftedCost final : public ceres::SizedCostFunction<2, kPoseSize, 3, kSharedSize> {
 public:
  ShiftedCost(const Eigen::Vector2d& n,
              const Eigen::Vector2d& d_shift,
              const Eigen::Matrix2d& whitening)
      : unshifted_(n, whitening), whitened_d_shift_(whitening * d_shift) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    unshifted_.Evaluate(parameters, residuals, jacobians);
    for (int i = 0; i < 2; ++i) residuals[i] -= parameters[2][0] * whitened_d_shift_[i];
    if (jacobians != nullptr && jacobians[2] != nullptr) {
      Eigen::Map<RowMajor26> d_shared(jacobians[2]);
      d_shared.setZero();
      d_shared.col(0) = -whitened_d_shift_;
    }
    return true;
  }

 private:
  CalibratedCost unshifted_;
  Eigen::Vector2d whitened_d_shift_;
};

class RefiningCost final : public ceres::SizedCostFunction<2, kPoseSize, 3, kSharedSize> {
 public:
  RefiningCost(const Camera* camera, const Eigen::Vector2d& xy, const Eigen::Matrix2d& whitening)
      : camera_(camera), xy_(xy), whitening_(whitening) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const NormalisedProjection p =
        ProjectNormalised(ReadPose(parameters[0]), Eigen::Vector3d(parameters[1]));
    const PixelProjection q =
        ProjectPixel(WithIntrinsics(*camera_, IntrinsicVector(parameters[2])), p.n);
    Eigen::Map<Eigen::Vector2d> residual(residuals);
    residual = whitening_ * (q.xy - xy_);
    if (jacobians == nullptr) return true;
    const Eigen::Matrix2d d_n = whitening_ * q.d_n;
    WriteSceneDerivatives(p, d_n, jacobians);
    if (jacobians[2] != nullptr) {
      Eigen::Map<RowMajor26> d_shared(jacobians[2]);
      d_shared.setZero();
      d_shared.leftCols<kIntrinsicSize>() = whitening_ * q.d_intrinsics;
    }
    return true;
  }

 private:
  const Camera* camera_;
  Eigen::Vector2d xy_;
  Eigen::Matrix2d whitening_;
};

// The same for a camera whose focal length is s times the shared one and whose centre is offset by
// d px in this frame: xy = c + s (xy of the shared camera - c) + d, with the frame's (log s, dx,
// dy) in a block of its own.
class ChangingLensCost final
    : public ceres::SizedCostFunction<2, kPoseSize, 3, kSharedSize, kSharedSize> {
 public:
  ChangingLensCost(const Camera* camera,
                   const Eigen::Vector2d& xy,
                   const Eigen::Matrix2d& whitening)
      : camera_(camera), xy_(xy), whitening_(whitening) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const NormalisedProjection p =
        ProjectNormalised(ReadPose(parameters[0]), Eigen::Vector3d(parameters[1]));
    const double scale = std::exp(parameters[2][0]);
    const Camera camera = WithIntrinsics(*camera_, IntrinsicVector(parameters[3]));
    const PixelProjection q = ProjectPixel(camera, p.n);
    const Eigen::Vector2d center(camera.cx, camera.cy);
    const Eigen::Vector2d from_center = scale * (q.xy - center);
    Eigen::Map<Eigen::Vector2d> residual(residuals);
    residual = whitening_ *
               (center + from_center + Eigen::Vector2d(parameters[2][1], parameters[2][2]) - xy_);
    if (jacobians == nullptr) return true;
    const Eigen::Matrix2d d_n = scale * whitening_ * q.d_n;
    WriteSceneDerivatives(p, d_n, jacobians);
    if (jacobians[2] != nullptr) {
      Eigen::Map<RowMajor26> d_lens(jacobians[2]);
      d_lens.setZero();
      d_lens.col(0) = whitening_ * from_center;
      d_lens.middleCols<2>(1) = whitening_;
    }
    if (jacobians[3] != nullptr) {
      Eigen::Map<RowMajor26> d_shared(jacobians[3]);
      d_shared.setZero();
      d_shared.leftCols<kIntrinsicSize>() = scale * whitening_ * q.d_intrinsics;
      d_shared.middleCols<2>(1) = whitening_;
    }
    return true;
  }

 private:
  const Camera* camera_;
  Eigen::Vector2d xy_;
  Eigen::Matrix2d whitening_;
};

// |(log s_b - log s_a) / sigma_s|^2 + |(d_b - d_a) / sigma_d|^2 of two frames: a lens changes
// smoothly.
class LensWalk final : public ceres::SizedCostFunction<3, kSharedSize, kSharedSize> {
 public:
  explicit LensWalk(const Eigen::Vector3d& sigma) : information_(sigma.cwiseInverse()) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    for (int i = 0; i < 3; ++i) {
      residuals[i] = information_[i] * (parameters[1][i] - parameters[0][i]);
    }
    if (jacobians == nullptr) return true;
    for (int side = 0; side < 2; ++side) {
      if (jacobians[side] == nullptr) continue;
      Eigen::Map<Eigen::Matrix<double, 3, kSharedSize, Eigen::RowMajor>> d(jacobians[side]);
      d.setZero();
      for (int i = 0; i < 3; ++i) d(i, i) = side == 0 ? -information_[i] : information_[i];
    }
    return true;
  }

 private:
  Eigen::Vector3d information_;
};

// (log(f / guess) noise / sigma)^2
class FocalPrior final : public ceres::SizedCostFunction<1, kSharedSize> {
 public:
  FocalPrior(double guess, double log_sigma, double noise)
      : guess_(guess), log_sigma_(log_sigma / noise) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const double focal = parameters[0][0];
    if (focal <= 0.0) return false;
    residuals[0] = std::log(focal / guess_) / log_sigma_;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 1, kSharedSize>> d(jacobians[0]);
      d.setZero();
      d[0] = 1.0 / (focal * log_sigma_);
    }
    return true;
  }

 private:
  double guess_;
  double log_sigma_;
};

// (k1 r^2 noise / sigma)^2 + (k2 r^4 noise / sigma)^2, with r = corner / f: how far the lens moves
// the picture's corner, `corner_px` from its centre. This bounds coefficients that the tracks do
// not determine, and the units make it the same for narrow and wide lenses.
class RadialPrior final : public ceres::SizedCostFunction<2, kSharedSize> {
 public:
  RadialPrior(double corner_px, double sigma, double noise)
      : corner_px_(corner_px), sigma_(sigma / noise) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const double focal = parameters[0][0];
    if (focal <= 0.0) return false;
    const double r2 = corner_px_ * corner_px_ / (focal * focal);
    const double k1 = parameters[0][3];
    const double k2 = parameters[0][4];
    residuals[0] = k1 * r2 / sigma_;
    residuals[1] = k2 * r2 * r2 / sigma_;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<RowMajor26> d(jacobians[0]);
      d.setZero();
      d(0, 0) = -2.0 * residuals[0] / focal;
      d(1, 0) = -4.0 * residuals[1] / focal;
      d(0, 3) = r2 / sigma_;
      d(1, 4) = r2 * r2 / sigma_;
    }
    return true;
  }

 private:
  double corner_px_;
  double sigma_;
};

// |(cx, cy) - guess|^2 (noise / sigma)^2
class CenterPrior final : public ceres::SizedCostFunction<2, kSharedSize> {
 public:
  CenterPrior(const Eigen::Vector2d& guess, double sigma_px, double noise)
      : guess_(guess), sigma_px_(sigma_px / noise) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    for (int i = 0; i < 2; ++i) residuals[i] = (parameters[0][1 + i] - guess_[i]) / sigma_px_;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<RowMajor26> d(jacobians[0]);
      d.setZero();
      d(0, 1) = d(1, 2) = 1.0 / sigma_px_;
    }
    return true;
  }

 private:
  Eigen::Vector2d guess_;
  double sigma_px_;
};

// (|c_b - c_a| / length - 1) / sigma, where camera a is fixed: holds the scale while covariances
// are computed.
class ScaleGauge final : public ceres::SizedCostFunction<1, kPoseSize> {
 public:
  ScaleGauge(const Eigen::Vector3d& fixed_center, double length)
      : fixed_center_(fixed_center), length_(length) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    constexpr double kSigma = 1e-6;
    const Eigen::Vector3d baseline = Eigen::Vector3d(parameters[0] + 4) - fixed_center_;
    const double length = baseline.norm();
    residuals[0] = (length / length_ - 1.0) / kSigma;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 1, kPoseSize>> d(jacobians[0]);
      d.setZero();
      d.segment<3>(3) = baseline.transpose() / (length * length_ * kSigma);
    }
    return true;
  }

 private:
  Eigen::Vector3d fixed_center_;
  double length_;
};

}  // namespace cohort
