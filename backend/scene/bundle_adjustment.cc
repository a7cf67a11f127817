#include "backend/scene/bundle_adjustment.h"

#include <ceres/ceres.h>
#include <fmt/format.h>
#include <glog/logging.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <deque>
#include <map>
#include <memory>

#include "backend/scene/reprojection.h"

namespace cohort {
namespace {

using RowMajor27 = Eigen::Matrix<double, 2, 7, Eigen::RowMajor>;
using RowMajor23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using RowMajor25 = Eigen::Matrix<double, 2, 5, Eigen::RowMajor>;

constexpr int kPoseSize = 7;  // quaternion x, y, z, w; centre
constexpr int kIntrinsicSize = 5;

CameraPose ReadPose(const double* pose) {
  return {Eigen::Quaterniond(pose), Eigen::Vector3d(pose + 4)};
}

// Cost functions give derivatives by the pose's 6-vector in the first six of the seven columns, and
// this manifold's Jacobian [I_6; 0] passes them on: the chain through the quaternion is saved.
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

// Known intrinsics: the observation is unprojected once to n, and the residual W (n(x) - n) has in
// W the pixels' covariance and the camera's derivative at n.
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
    if (jacobians[0] != nullptr) {
      Eigen::Map<RowMajor27> d_pose(jacobians[0]);
      d_pose.leftCols<6>() = whitening_ * p.d_pose;
      d_pose.col(6).setZero();
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<RowMajor23> d_point(jacobians[1]);
      d_point = whitening_ * p.d_point;
    }
    return true;
  }

 private:
  Eigen::Vector2d n_;
  Eigen::Matrix2d whitening_;
};

class RefiningCost final : public ceres::SizedCostFunction<2, kPoseSize, 3, kIntrinsicSize> {
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
    if (jacobians[0] != nullptr) {
      Eigen::Map<RowMajor27> d_pose(jacobians[0]);
      d_pose.leftCols<6>() = d_n * p.d_pose;
      d_pose.col(6).setZero();
    }
    if (jacobians[1] != nullptr) {
      Eigen::Map<RowMajor23> d_point(jacobians[1]);
      d_point = d_n * p.d_point;
    }
    if (jacobians[2] != nullptr) {
      Eigen::Map<RowMajor25> d_intrinsics(jacobians[2]);
      d_intrinsics = whitening_ * q.d_intrinsics;
    }
    return true;
  }

 private:
  const Camera* camera_;
  Eigen::Vector2d xy_;
  Eigen::Matrix2d whitening_;
};

// (log(f / guess) / sigma)^2
class FocalPrior final : public ceres::SizedCostFunction<1, kIntrinsicSize> {
 public:
  FocalPrior(double guess, double log_sigma) : guess_(guess), log_sigma_(log_sigma) {}
  bool Evaluate(double const* const* parameters,
                double* residuals,
                double** jacobians) const override {
    const double focal = parameters[0][0];
    if (focal <= 0.0) return false;
    residuals[0] = std::log(focal / guess_) / log_sigma_;
    if (jacobians != nullptr && jacobians[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, 1, kIntrinsicSize>> d(jacobians[0]);
      d.setZero();
      d[0] = 1.0 / (focal * log_sigma_);
    }
    return true;
  }

 private:
  double guess_;
  double log_sigma_;
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

Eigen::Matrix2d Whitening(const BundleObservation& observation) {
  const Eigen::LLT<Eigen::Matrix2d> cholesky(observation.covariance_px2);
  if (cholesky.info() != Eigen::Success) {
    ThrowError("bundle adjustment: the covariance of an observation is not positive definite");
  }
  return cholesky.matrixL().solve(Eigen::Matrix2d::Identity());
}

// The problem as Ceres holds it. Owns all that Ceres points into.
class Adjuster {
 public:
  Adjuster(BundleProblem problem, const BundleOptions& options)
      : problem_(std::move(problem)),
        options_(options),
        intrinsics_(ToIntrinsicVector(problem_.intrinsics)) {
    CheckIndices();
    for (const BundleCamera& camera : problem_.cameras) {
      const Rigid3 world_from_cam = camera.cam_from_world.Inverse();
      Eigen::Matrix<double, kPoseSize, 1> pose;
      pose << camera.cam_from_world.rotation.normalized().coeffs(), world_from_cam.translation;
      poses_.push_back(pose);
    }
    SettleGauge();
    MakeLoss();
    AddObservations();
  }

  BundleResult Run() {
    BundleResult result;
    // Levenberg-Marquardt answers a step that cannot be computed with a shorter one; Ceres would
    // print a warning each time.
    FLAGS_minloglevel = std::max<int>(FLAGS_minloglevel, google::GLOG_ERROR);
    ceres::Solver::Options solver;
    solver.max_num_iterations = options_.max_iterations;
    solver.function_tolerance = options_.function_tolerance;
    solver.gradient_tolerance = 1e-10;
    solver.parameter_tolerance = 1e-9;
    solver.num_threads = 1;  // more add in an order of their own: not the same bytes twice
    solver.logging_type = ceres::SILENT;
    ChooseLinearSolver(solver);

    ceres::Solver::Summary summary;
    ceres::Solve(solver, ceres_.get(), &summary);
    switch (summary.termination_type) {
      case ceres::CONVERGENCE:
      case ceres::USER_SUCCESS:
        result.termination = BundleTermination::kConverged;
        break;
      case ceres::NO_CONVERGENCE:
        result.termination = BundleTermination::kMaxIterations;
        break;
      case ceres::FAILURE:
      case ceres::USER_FAILURE:
        result.termination = BundleTermination::kFailed;
        break;
    }
    result.initial_cost = summary.initial_cost;
    result.final_cost = summary.final_cost;
    result.iterations = static_cast<int>(summary.iterations.size()) - 1;
    RestoreScale();
    if (options_.covariances && result.termination != BundleTermination::kFailed) {
      result.covariances = EstimateCovariances();
    }
    WriteBack();
    result.solution = std::move(problem_);
    return result;
  }

 private:
  void CheckIndices() const {
    const int cameras = static_cast<int>(problem_.cameras.size());
    const int points = static_cast<int>(problem_.points_in_world.size());
    for (const BundleObservation& o : problem_.observations) {
      if (o.camera < 0 || o.camera >= cameras || o.point < 0 || o.point >= points) {
        ThrowError(
            "bundle adjustment: an observation names camera {} and point {}, but there are {} "
            "cameras and {} points",
            o.camera,
            o.point,
            cameras,
            points);
      }
    }
  }

  void SettleGauge() {
    std::vector<int> fixed;
    for (int i = 0; i < static_cast<int>(poses_.size()); ++i) {
      if (problem_.cameras[i].fixed) fixed.push_back(i);
    }
    anchor_ = fixed.empty() ? 0 : fixed.front();
    if (fixed.size() > 1) return;
    double farthest = 0.0;
    for (int i = 0; i < static_cast<int>(poses_.size()); ++i) {
      const double distance = (Center(i) - Center(anchor_)).norm();
      if (distance > farthest) {
        farthest = distance;
        scale_camera_ = i;
        scale_length_ = distance;
      }
    }
  }

  Eigen::Vector3d Center(int camera) const { return poses_[camera].tail<3>(); }

  void MakeLoss() {
    switch (options_.loss) {
      case RobustLoss::kNone:
        break;
      case RobustLoss::kHuber:
        loss_ = std::make_unique<ceres::HuberLoss>(options_.loss_scale);
        break;
      case RobustLoss::kCauchy:
        loss_ = std::make_unique<ceres::CauchyLoss>(options_.loss_scale);
        break;
    }
  }

  void AddObservations() {
    ceres::Problem::Options ownership;
    ownership.cost_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ownership.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ownership.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
    ownership.disable_all_safety_checks = true;
    ceres_ = std::make_unique<ceres::Problem>(ownership);

    const bool refines = options_.RefinesIntrinsics();
    has_observation_.assign(poses_.size(), false);
    point_used_.assign(problem_.points_in_world.size(), false);
    for (const BundleObservation& o : problem_.observations) {
      const Eigen::Matrix2d whitening = Whitening(o);
      double* pose = poses_[o.camera].data();
      double* point = problem_.points_in_world[o.point].data();
      has_observation_[o.camera] = true;
      point_used_[o.point] = true;
      if (refines) {
        refining_.emplace_back(&problem_.intrinsics, o.xy, whitening);
        ceres_->AddResidualBlock(&refining_.back(), loss_.get(), pose, point, intrinsics_.data());
      } else {
        const Eigen::Vector2d n = problem_.intrinsics.Unproject(o.xy);
        calibrated_.emplace_back(n, whitening * ProjectPixel(problem_.intrinsics, n).d_n);
        ceres_->AddResidualBlock(&calibrated_.back(), loss_.get(), pose, point);
      }
    }
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!has_observation_[i]) continue;
      ceres_->SetManifold(poses_[i].data(), &pose_manifold_);
      if (problem_.cameras[i].fixed || static_cast<int>(i) == anchor_) {
        ceres_->SetParameterBlockConstant(poses_[i].data());
      }
    }
    if (refines && !problem_.observations.empty()) HoldIntrinsics();
  }

  std::vector<int> RefinedIntrinsics() const {
    std::vector<int> refined;
    if (options_.refine_focal) refined.push_back(0);
    if (options_.refine_principal_point) refined.insert(refined.end(), {1, 2});
    if (options_.refine_radial) refined.insert(refined.end(), {3, 4});
    return refined;
  }

  void HoldIntrinsics() {
    const std::vector<int> refined = RefinedIntrinsics();
    std::vector<int> constant;
    for (int i = 0; i < kIntrinsicSize; ++i) {
      if (std::find(refined.begin(), refined.end(), i) == refined.end()) constant.push_back(i);
    }
    if (!constant.empty()) {
      intrinsic_manifold_ = std::make_unique<ceres::SubsetManifold>(kIntrinsicSize, constant);
      ceres_->SetManifold(intrinsics_.data(), intrinsic_manifold_.get());
    }
    if (options_.refine_focal) {
      focal_prior_ =
          std::make_unique<FocalPrior>(problem_.intrinsics.fx, options_.focal_prior_log_sigma);
      ceres_->AddResidualBlock(focal_prior_.get(), nullptr, intrinsics_.data());
    }
  }

  void ChooseLinearSolver(ceres::Solver::Options& solver) {
    int free_cameras = 0;
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!has_observation_[i]) continue;
      ordering->AddElementToGroup(poses_[i].data(), 1);
      if (!ceres_->IsParameterBlockConstant(poses_[i].data())) ++free_cameras;
    }
    for (std::size_t i = 0; i < point_used_.size(); ++i) {
      if (point_used_[i]) ordering->AddElementToGroup(problem_.points_in_world[i].data(), 0);
    }
    if (!refining_.empty()) ordering->AddElementToGroup(intrinsics_.data(), 1);
    solver.linear_solver_ordering = ordering;
    // Tracks of a video are short against the clip, so the reduced camera matrix is a band and its
    // sparse factor stays small far beyond the sizes that unordered photographs allow.
    constexpr int kMaxDense = 200;
    constexpr int kMaxSparse = 4000;
    if (free_cameras <= kMaxDense) {
      solver.linear_solver_type = ceres::DENSE_SCHUR;
    } else if (free_cameras <= kMaxSparse) {
      solver.linear_solver_type = ceres::SPARSE_SCHUR;
    } else {
      solver.linear_solver_type = ceres::ITERATIVE_SCHUR;
      solver.preconditioner_type = ceres::SCHUR_JACOBI;
    }
  }

  // The cost does not change with the scale of the world, so it is set after the last step: with
  // respect to the anchor's centre, back to the length that the problem came with.
  void RestoreScale() {
    if (!scale_camera_) return;
    const Eigen::Vector3d origin = Center(anchor_);
    const double length = (Center(*scale_camera_) - origin).norm();
    if (!(length > 0.0)) return;
    const double scale = scale_length_ / length;
    for (auto& pose : poses_) pose.tail<3>() = origin + scale * (pose.tail<3>() - origin);
    for (auto& point : problem_.points_in_world) point = origin + scale * (point - origin);
  }

  void WriteBack() {
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (static_cast<int>(i) == anchor_ || problem_.cameras[i].fixed) continue;  // keep its bits
      const CameraPose pose = ReadPose(poses_[i].data());
      problem_.cameras[i].cam_from_world = {pose.rotation, -(pose.rotation * pose.center)};
    }
    problem_.intrinsics = WithIntrinsics(problem_.intrinsics, intrinsics_);
  }

  std::optional<BundleCovariances> EstimateCovariances() {
    std::unique_ptr<ScaleGauge> gauge;
    if (scale_camera_ && has_observation_[*scale_camera_]) {
      gauge = std::make_unique<ScaleGauge>(Center(anchor_), scale_length_);
      ceres_->AddResidualBlock(gauge.get(), nullptr, poses_[*scale_camera_].data());
    }
    // Columns: the points, then the poses that are free, then the intrinsics.
    ceres::Problem::EvaluateOptions evaluate;
    std::vector<int> points;
    std::vector<int> cameras;
    for (std::size_t i = 0; i < point_used_.size(); ++i) {
      if (!point_used_[i]) continue;
      points.push_back(static_cast<int>(i));
      evaluate.parameter_blocks.push_back(problem_.points_in_world[i].data());
    }
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!has_observation_[i] || ceres_->IsParameterBlockConstant(poses_[i].data())) continue;
      cameras.push_back(static_cast<int>(i));
      evaluate.parameter_blocks.push_back(poses_[i].data());
    }
    if (!refining_.empty()) evaluate.parameter_blocks.push_back(intrinsics_.data());
    ceres::CRSMatrix jacobian;
    if (!ceres_->Evaluate(evaluate, nullptr, nullptr, nullptr, &jacobian)) return std::nullopt;

    // The normal equations [V W'; W U], and their inverse by the Schur complement of the points,
    // S = U - sum W V^-1 W': S^-1 for the cameras, V^-1 + V^-1 W' S^-1 W V^-1 for a point.
    const int first_camera = 3 * static_cast<int>(points.size());
    const int others = jacobian.num_cols - first_camera;
    Eigen::MatrixXd S = Eigen::MatrixXd::Zero(others, others);
    struct PointBlock {
      Eigen::Matrix3d V = Eigen::Matrix3d::Zero();
      std::map<int, Eigen::Vector3d> W;  // by column of S
    };
    std::vector<PointBlock> blocks(points.size());
    for (int row = 0; row < jacobian.num_rows; ++row) {
      int point = -1;
      Eigen::Vector3d d_point = Eigen::Vector3d::Zero();
      std::vector<std::pair<int, double>> d_others;
      for (int k = jacobian.rows[row]; k < jacobian.rows[row + 1]; ++k) {
        const int col = jacobian.cols[k];
        if (col < first_camera) {
          point = col / 3;
          d_point[col % 3] = jacobian.values[k];
        } else {
          d_others.emplace_back(col - first_camera, jacobian.values[k]);
        }
      }
      for (const auto& [i, d_i] : d_others) {
        for (const auto& [j, d_j] : d_others) S(i, j) += d_i * d_j;
        if (point < 0) continue;
        const auto at = blocks[point].W.try_emplace(i, Eigen::Vector3d::Zero()).first;
        at->second += d_i * d_point;
      }
      if (point >= 0) blocks[point].V += d_point * d_point.transpose();
    }
    const auto columns_of = [](const PointBlock& block) {
      std::pair<std::vector<int>, Eigen::Matrix3Xd> result{
          {}, Eigen::Matrix3Xd(3, static_cast<Eigen::Index>(block.W.size()))};
      for (const auto& [column, w] : block.W) {
        result.second.col(static_cast<Eigen::Index>(result.first.size())) = w;
        result.first.push_back(column);
      }
      return result;
    };
    for (const PointBlock& block : blocks) {
      const Eigen::LLT<Eigen::Matrix3d> V(block.V);
      if (V.info() != Eigen::Success) return std::nullopt;
      const auto [columns, W] = columns_of(block);
      S(columns, columns) -= W.transpose() * V.solve(W);
    }
    const Eigen::LLT<Eigen::MatrixXd> cholesky(S);
    if (cholesky.info() != Eigen::Success) return std::nullopt;
    S = cholesky.solve(Eigen::MatrixXd::Identity(others, others));
    if (!S.allFinite()) return std::nullopt;

    BundleCovariances result;
    result.cameras.resize(poses_.size(), Eigen::Matrix<double, 6, 6>::Zero());
    result.points.resize(point_used_.size(), Eigen::Matrix3d::Zero());
    result.intrinsics.setZero();
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const auto at = static_cast<Eigen::Index>(6 * i);
      result.cameras[cameras[i]] = S.block<6, 6>(at, at);
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto [columns, W] = columns_of(blocks[i]);
      const Eigen::Matrix3d inverse = blocks[i].V.inverse();
      const Eigen::Matrix3Xd gain = inverse * W;
      result.points[points[i]] = inverse + gain * S(columns, columns) * gain.transpose();
    }
    if (!refining_.empty()) {
      const auto at = static_cast<Eigen::Index>(6 * cameras.size());
      const std::vector<int> refined = RefinedIntrinsics();
      for (std::size_t i = 0; i < refined.size(); ++i) {
        for (std::size_t j = 0; j < refined.size(); ++j) {
          result.intrinsics(refined[i], refined[j]) =
              S(at + static_cast<Eigen::Index>(i), at + static_cast<Eigen::Index>(j));
        }
      }
    }
    return result;
  }

  BundleProblem problem_;
  BundleOptions options_;
  IntrinsicVector intrinsics_;
  std::vector<Eigen::Matrix<double, kPoseSize, 1>> poses_;
  int anchor_ = 0;
  std::optional<int> scale_camera_;  // none if two cameras or more are fixed
  double scale_length_ = 0.0;
  std::unique_ptr<ceres::LossFunction> loss_;
  PoseManifold pose_manifold_;
  std::unique_ptr<ceres::SubsetManifold> intrinsic_manifold_;
  std::unique_ptr<FocalPrior> focal_prior_;
  std::deque<CalibratedCost> calibrated_;  // Ceres points into it
  std::deque<RefiningCost> refining_;
  std::vector<bool> has_observation_;
  std::vector<bool> point_used_;
  std::unique_ptr<ceres::Problem> ceres_;  // last: it points into all of the above
};

}  // namespace

BundleResult AdjustBundle(BundleProblem problem, const BundleOptions& options) {
  ValidateOptions(options);
  Adjuster adjuster(std::move(problem), options);
  return adjuster.Run();
}

std::string BundleResult::Brief() const {
  const char* how = termination == BundleTermination::kConverged       ? "converged"
                    : termination == BundleTermination::kMaxIterations ? "stopped"
                                                                       : "failed";
  return fmt::format("bundle adjustment {} after {} iterations, cost {:.6g} -> {:.6g}",
                     how,
                     iterations,
                     initial_cost,
                     final_cost);
}

}  // namespace cohort
