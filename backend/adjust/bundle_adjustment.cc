#include "backend/adjust/bundle_adjustment.h"

#include <ceres/ceres.h>
#include <fmt/format.h>
#include <glog/logging.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <exception>
#include <functional>
#include <memory>

#include "backend/adjust/bundle_costs.h"
#include "backend/adjust/bundle_covariances.h"
#include "frontend/core/interruption.h"

namespace cohort {
namespace {

Eigen::Matrix2d Whitening(const BundleObservation& observation) {
  const Eigen::LLT<Eigen::Matrix2d> cholesky(observation.covariance_px2);
  if (cholesky.info() != Eigen::Success) {
    ThrowError("bundle adjustment: the covariance of an observation is not positive definite");
  }
  return cholesky.matrixL().solve(Eigen::Matrix2d::Identity());
}

std::vector<int> Indices(const std::array<bool, kSharedSize>& values, bool value) {
  std::vector<int> indices;
  for (int i = 0; i < kSharedSize; ++i) {
    if (values[i] == value) indices.push_back(i);
  }
  return indices;
}

// Ends an interrupted adjustment at the next iteration, because nothing may be thrown through
// Ceres.
class InterruptionCallback final : public ceres::IterationCallback {
 public:
  ceres::CallbackReturnType operator()(const ceres::IterationSummary&) override {
    try {
      CheckInterruption();
    } catch (...) {
      thrown_ = std::current_exception();
      return ceres::SOLVER_ABORT;
    }
    return ceres::SOLVER_CONTINUE;
  }

  void Rethrow() const {
    if (thrown_) std::rethrow_exception(thrown_);
  }

 private:
  std::exception_ptr thrown_;
};

// Ends an adjustment once the camera has settled (BundleOptions::settled_camera).
class SettledCameraCallback final : public ceres::IterationCallback {
 public:
  SettledCameraCallback(std::function<Camera()> now, double bound)
      : now_(std::move(now)), bound_(bound), before_(now_()) {}

  ceres::CallbackReturnType operator()(const ceres::IterationSummary& step) override {
    constexpr int kSteps = 3;
    if (!step.step_is_successful) return ceres::SOLVER_CONTINUE;
    const Camera camera = now_();
    const double moved =
        std::max(CornerShift(before_, camera), std::abs(std::log(camera.fx / before_.fx)));
    still_ = moved < bound_ ? still_ + 1 : 0;
    before_ = camera;
    return still_ == kSteps ? ceres::SOLVER_TERMINATE_SUCCESSFULLY : ceres::SOLVER_CONTINUE;
  }

 private:
  std::function<Camera()> now_;
  double bound_;
  Camera before_;
  int still_ = 0;
};

// The problem in Ceres' form. Owns everything that Ceres points into.
class Adjuster {
 public:
  Adjuster(BundleProblem problem, const BundleOptions& options)
      : problem_(std::move(problem)), options_(options) {
    CheckIndices();
    Check(!(options.refine_shift && options.RefinesIntrinsics()),
          "either the shift or intrinsics are refined");
    if (options.refine_shift) {
      shared_[0] = problem_.shift;
    } else {
      shared_.head<kIntrinsicSize>() = ToIntrinsicVector(problem_.intrinsics);
    }
    for (const BundleCamera& camera : problem_.cameras) {
      const Rigid3 world_from_cam = camera.cam_from_world.Inverse();
      Eigen::Matrix<double, kPoseSize, 1> pose;
      pose << camera.cam_from_world.rotation.normalized().coeffs(), world_from_cam.translation;
      poses_.push_back(pose);
    }
    for (const BundleCamera& camera : problem_.cameras) {
      lenses_.emplace_back(SharedVector::Zero()).head<3>() = camera.lens_change;
    }
    SettleGauge();
    MakeLoss();
    AddObservations();
  }

  BundleResult Run() {
    BundleResult result;
    // If a step cannot be computed, Levenberg-Marquardt tries a shorter one; Ceres would print a
    // warning each time.
    FLAGS_minloglevel = std::max<int>(FLAGS_minloglevel, google::GLOG_ERROR);
    ceres::Solver::Options solver;
    solver.max_num_iterations = options_.max_iterations;
    solver.function_tolerance = options_.function_tolerance;
    solver.initial_trust_region_radius = options_.trust_radius;
    // Beyond this the damping is below the rounding errors of the equations, and steps are invalid.
    constexpr double kMostTrust = 1e10;
    solver.max_trust_region_radius = std::max(kMostTrust, options_.trust_radius);
    solver.gradient_tolerance = 1e-10;
    solver.parameter_tolerance = 1e-9;
    solver.num_threads = 1;  // more threads sum in varying order: results would not be reproducible
    solver.logging_type = ceres::SILENT;
    ChooseLinearSolver(solver);

    InterruptionCallback interruption;
    solver.callbacks.push_back(&interruption);
    SettledCameraCallback settled(
        [this] { return WithIntrinsics(problem_.intrinsics, shared_.head<kIntrinsicSize>()); },
        options_.settled_camera);
    if (options_.settled_camera > 0.0) {
      solver.callbacks.push_back(&settled);
      solver.update_state_every_iteration = true;
    }

    ceres::Solver::Summary summary;
    ceres::Solve(solver, ceres_.get(), &summary);
    interruption.Rethrow();
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
      if (options_.refine_lens_changes) {
        changing_.emplace_back(&problem_.intrinsics, o.xy, whitening);
        ceres_->AddResidualBlock(
            &changing_.back(), loss_.get(), pose, point, lenses_[o.camera].data(), shared_.data());
      } else if (refines) {
        refining_.emplace_back(&problem_.intrinsics, o.xy, whitening);
        ceres_->AddResidualBlock(&refining_.back(), loss_.get(), pose, point, shared_.data());
      } else {
        const Eigen::Vector2d n = problem_.intrinsics.Unproject(o.xy);
        const Eigen::Matrix2d d_n = ProjectPixel(problem_.intrinsics, n).d_n;
        if (options_.refine_shift) {
          shifted_.emplace_back(n, d_n.inverse() * o.d_shift, whitening * d_n);
          ceres_->AddResidualBlock(&shifted_.back(), loss_.get(), pose, point, shared_.data());
        } else {
          calibrated_.emplace_back(n, whitening * d_n);
          ceres_->AddResidualBlock(&calibrated_.back(), loss_.get(), pose, point);
        }
      }
    }
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!has_observation_[i]) continue;
      ceres_->SetManifold(poses_[i].data(), &pose_manifold_);
      if (problem_.cameras[i].fixed || static_cast<int>(i) == anchor_) {
        ceres_->SetParameterBlockConstant(poses_[i].data());
      }
    }
    if (SharesUnknowns()) HoldShared();
    if (options_.refine_lens_changes) WalkLenses();
  }

  bool SharesUnknowns() const {
    return !refining_.empty() || !shifted_.empty() || !changing_.empty();
  }

  // Links the lenses of the cameras that have observations, and fixes the first one's.
  void WalkLenses() {
    const Eigen::Vector3d sigma(
        options_.zoom_walk_sigma, options_.center_walk_sigma_px, options_.center_walk_sigma_px);
    lens_walk_ = std::make_unique<LensWalk>(sigma / options_.prior_noise);
    lens_manifold_ = std::make_unique<SharedManifold>(
        std::array<bool, kSharedSize>{true, true, true, false, false, false});
    double* last = nullptr;
    for (std::size_t i = 0; i < lenses_.size(); ++i) {
      if (!has_observation_[i]) continue;
      ceres_->SetManifold(lenses_[i].data(), lens_manifold_.get());
      if (last == nullptr) {
        ceres_->SetParameterBlockConstant(lenses_[i].data());
      } else {
        ceres_->AddResidualBlock(lens_walk_.get(), nullptr, last, lenses_[i].data());
      }
      last = lenses_[i].data();
    }
  }

  std::array<bool, kSharedSize> FreeOfShared() const {
    const bool principal_point = options_.refine_principal_point;
    return {options_.refine_shift || options_.refine_focal,
            principal_point,
            principal_point,
            options_.refine_radial,
            options_.refine_radial};
  }

  void HoldShared() {
    shared_manifold_ = std::make_unique<SharedManifold>(FreeOfShared());
    ceres_->SetManifold(shared_.data(), shared_manifold_.get());
    if (options_.refine_focal) {
      const double guess_px =
          options_.focal_prior_px > 0.0 ? options_.focal_prior_px : problem_.intrinsics.fx;
      focal_prior_ = std::make_unique<FocalPrior>(
          guess_px, options_.focal_prior_log_sigma, options_.prior_noise);
      ceres_->AddResidualBlock(focal_prior_.get(), nullptr, shared_.data());
    }
    const Camera& camera = problem_.intrinsics;
    const double corner_px = 0.5 * std::hypot(camera.width_px, camera.height_px);
    if (options_.refine_radial && corner_px > 0.0) {
      radial_prior_ = std::make_unique<RadialPrior>(
          corner_px, options_.radial_prior_sigma, options_.prior_noise);
      ceres_->AddResidualBlock(radial_prior_.get(), nullptr, shared_.data());
    }
    const int longer_px = std::max(camera.width_px, camera.height_px);
    if (options_.refine_principal_point && longer_px > 0) {
      const Eigen::Vector2d middle(0.5 * (camera.width_px - 1), 0.5 * (camera.height_px - 1));
      center_prior_ = std::make_unique<CenterPrior>(
          middle, options_.center_prior_sigma * longer_px, options_.prior_noise);
      ceres_->AddResidualBlock(center_prior_.get(), nullptr, shared_.data());
    }
  }

  void ChooseLinearSolver(ceres::Solver::Options& solver) {
    int free_cameras = 0;
    auto ordering = std::make_shared<ceres::ParameterBlockOrdering>();
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!has_observation_[i]) continue;
      ordering->AddElementToGroup(poses_[i].data(), 1);
      if (!ceres_->IsParameterBlockConstant(poses_[i].data())) ++free_cameras;
      if (options_.refine_lens_changes) ordering->AddElementToGroup(lenses_[i].data(), 1);
    }
    for (std::size_t i = 0; i < point_used_.size(); ++i) {
      if (point_used_[i]) ordering->AddElementToGroup(problem_.points_in_world[i].data(), 0);
    }
    if (SharesUnknowns()) ordering->AddElementToGroup(shared_.data(), 1);
    solver.linear_solver_ordering = ordering;
    // Tracks of a video are short compared with the clip, so the reduced camera matrix is banded,
    // and its sparse factor stays small far beyond the sizes that unordered photographs allow.
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

  // The cost does not depend on the scale of the world, so the scale is restored after the last
  // step: about the anchor's centre, to the problem's initial length.
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
      // A fixed pose keeps its bits.
      if (static_cast<int>(i) == anchor_ || problem_.cameras[i].fixed) continue;
      const CameraPose pose = ReadPose(poses_[i].data());
      problem_.cameras[i].cam_from_world = {pose.rotation, -(pose.rotation * pose.center)};
    }
    for (std::size_t i = 0; i < lenses_.size(); ++i) {
      problem_.cameras[i].lens_change = lenses_[i].head<3>();
    }
    if (options_.refine_shift) {
      problem_.shift = shared_[0];
    } else {
      problem_.intrinsics = WithIntrinsics(problem_.intrinsics, shared_.head<kIntrinsicSize>());
    }
  }

  std::optional<BundleCovariances> EstimateCovariances() {
    std::unique_ptr<ScaleGauge> gauge;
    if (scale_camera_ && has_observation_[*scale_camera_]) {
      gauge = std::make_unique<ScaleGauge>(Center(anchor_), scale_length_);
      ceres_->AddResidualBlock(gauge.get(), nullptr, poses_[*scale_camera_].data());
    }
    ceres::Problem::EvaluateOptions evaluate;
    JacobianColumns columns;
    for (std::size_t i = 0; i < point_used_.size(); ++i) {
      if (!point_used_[i]) continue;
      columns.points.push_back(static_cast<int>(i));
      evaluate.parameter_blocks.push_back(problem_.points_in_world[i].data());
    }
    for (std::size_t i = 0; i < poses_.size(); ++i) {
      if (!has_observation_[i] || ceres_->IsParameterBlockConstant(poses_[i].data())) continue;
      columns.cameras.push_back(static_cast<int>(i));
      evaluate.parameter_blocks.push_back(poses_[i].data());
    }
    std::unique_ptr<ceres::SubsetManifold> without_held;
    if (!refining_.empty()) {
      columns.intrinsics = Indices(FreeOfShared(), true);
      without_held =
          std::make_unique<ceres::SubsetManifold>(kSharedSize, Indices(FreeOfShared(), false));
      ceres_->SetManifold(shared_.data(), without_held.get());
      evaluate.parameter_blocks.push_back(shared_.data());
    }
    ceres::CRSMatrix jacobian;
    if (!ceres_->Evaluate(evaluate, nullptr, nullptr, nullptr, &jacobian)) return std::nullopt;
    return CovariancesFromJacobian(jacobian, columns, poses_.size(), point_used_.size());
  }

  BundleProblem problem_;
  BundleOptions options_;
  SharedVector shared_ = SharedVector::Zero();  // intrinsics, or the shift
  std::vector<Eigen::Matrix<double, kPoseSize, 1>> poses_;
  std::vector<SharedVector> lenses_;
  int anchor_ = 0;
  std::optional<int> scale_camera_;  // nullopt if two cameras or more are fixed
  double scale_length_ = 0.0;
  std::unique_ptr<ceres::LossFunction> loss_;
  PoseManifold pose_manifold_;
  std::unique_ptr<SharedManifold> shared_manifold_;
  std::unique_ptr<FocalPrior> focal_prior_;
  std::unique_ptr<RadialPrior> radial_prior_;
  std::unique_ptr<CenterPrior> center_prior_;
  std::unique_ptr<LensWalk> lens_walk_;
  std::unique_ptr<SharedManifold> lens_manifold_;
  std::deque<CalibratedCost> calibrated_;  // Ceres points into it
  std::deque<ShiftedCost> shifted_;
  std::deque<RefiningCost> refining_;
  std::deque<ChangingLensCost> changing_;
  std::vector<bool> has_observation_;
  std::vector<bool> point_used_;
  std::unique_ptr<ceres::Problem> ceres_;  // last: it points into all of the above
};

}  // namespace

double CornerShift(const Camera& a, const Camera& b) {
  const Eigen::Vector2d corner(0.0, 0.0);
  const Eigen::Vector2d n = a.Unproject(corner);
  const Eigen::Vector2d m = b.Unproject(corner);
  return (n - m).norm() / n.norm();
}

BundleResult AdjustBundle(BundleProblem problem, const BundleOptions& options) {
  CheckInterruption();
  Check(options.loss_scale > 0.0, "the scale of a robust loss is positive");
  Check(options.prior_noise > 0.0, "the noise that priors are relative to is positive");
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
