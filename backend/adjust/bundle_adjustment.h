#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "frontend/core/options.h"
#include "frontend/geometry/camera.h"
#include "frontend/geometry/rigid3.h"

namespace cohort {

// What bundle adjustment minimises over cameras, points and (if asked) intrinsics:
//   sum_k rho(|W_k (xy_k - projection of point_k in camera_k)|^2),  W_k^T W_k = covariance_k^-1
// With a shift, an unknown that all observations share, xy_k + shift d_shift_k replaces xy_k (to
// first order if the lens distorts).
struct BundleObservation {
  int camera = 0;                                // index into BundleProblem::cameras
  int point = 0;                                 // index into BundleProblem::points_in_world
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();  // pixels
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Identity();
  Eigen::Vector2d d_shift = Eigen::Vector2d::Zero();  // pixels; read with refine_shift
};

struct BundleCamera {
  Rigid3 cam_from_world;
  bool fixed = false;
  // With BundleOptions::refine_lens_changes: the logarithm of this camera's focal length over the
  // problem's, and the offset of its centre from the problem's [px]. (0, 0, 0) means no change.
  Eigen::Vector3d lens_change = Eigen::Vector3d::Zero();
};

struct BundleProblem {
  Camera intrinsics;  // of all cameras
  std::vector<BundleCamera> cameras;
  std::vector<Eigen::Vector3d> points_in_world;
  std::vector<BundleObservation> observations;
  double shift = 0.0;
};

enum class RobustLoss : std::uint8_t {
  kNone,    // rho(s) = s
  kCauchy,  // scale^2 log(1 + s / scale^2)
};

// The shift between two cameras of the ray through the picture's corner, as a share of its distance
// from the axis.
double CornerShift(const Camera& a, const Camera& b);

struct BundleOptions {
  static constexpr double kMaxLossScale = 1e3;

  RobustLoss loss = RobustLoss::kCauchy;
  double loss_scale = 1.0;  // in standard deviations of an observation
  int max_iterations = 50;
  double function_tolerance = 1e-6;  // relative decrease of the cost at which it has converged
  // Large values damp the first step little. A start near the optimum needs a much larger radius:
  // the drift of a long clip costs so little that damped steps do not remove it.
  double trust_radius = 1e4;
  bool refine_focal = false;
  bool refine_principal_point = false;
  bool refine_radial = false;
  bool refine_shift = false;  // not with intrinsics
  // The prior of the focal length counts as one observation of log(f / prior) with this standard
  // deviation, so it matters only where the tracks do not determine f. Only with refine_focal. 0 px
  // stands for the problem's focal length.
  double focal_prior_px = 0.0;
  double focal_prior_log_sigma = 1.0;
  // The prior of the principal point, with refine_principal_point: the standard deviation of its
  // offset from the picture's middle, as a share of the longer side.
  double center_prior_sigma = 0.03;
  // The prior of the lens, with refine_radial: the standard deviation of the share by which k1 and
  // k2 each move the picture's corner, k_i r^2i with r the corner's normalised distance from the
  // centre.
  double radial_prior_sigma = 0.3;
  // One standard deviation in units of the whitened residuals. It balances priors against
  // observations whose covariances are all too large or too small by one factor.
  double prior_noise = 1.0;
  // A focal length and a centre for each camera, for a lens that zooms or a stabiliser that shifts
  // the picture. The sigmas are the standard deviations of their change (log, px) from one camera
  // of the list to the next; camera 0 has the problem's values.
  bool refine_lens_changes = false;
  double zoom_walk_sigma = 0.02;
  double center_walk_sigma_px = 3.0;
  // With refined intrinsics: stops when each of the last three steps moved them by less than this
  // (CornerShift, and the logarithm of the focal length). 0 stops by the cost alone.
  double settled_camera = 0.0;
  bool covariances = false;

  bool RefinesIntrinsics() const { return refine_focal || refine_principal_point || refine_radial; }
};

enum class BundleTermination : std::uint8_t { kConverged, kMaxIterations, kFailed };

// Covariances of the estimate if the whitened residuals have unit variance, in the gauge that keeps
// the first camera and the distance to the camera farthest from it.
struct BundleCovariances {
  std::vector<Eigen::Matrix<double, 6, 6>> cameras;  // of (omega [rad], centre), see CameraPose
  std::vector<Eigen::Matrix3d> points;
  Eigen::MatrixXd centers;                 // of all centres together, three rows and columns each
  Eigen::Matrix<double, 5, 5> intrinsics;  // see IntrinsicVector; 0 for those kept fixed
};

struct BundleResult {
  BundleTermination termination = BundleTermination::kFailed;
  BundleProblem solution;     // the problem with the estimated values
  double initial_cost = 0.0;  // half the sum above
  double final_cost = 0.0;
  int iterations = 0;
  std::optional<BundleCovariances> covariances;

  std::string Brief() const;
};

// Levenberg-Marquardt with the points eliminated (dense, sparse or iterative Schur complement by
// the number of cameras) and analytic derivatives. The seven gauge freedoms are fixed by holding
// camera 0 (unless some camera is fixed already) and, if only one is fixed, the distance to the
// camera farthest from it. A camera or point without observations does not move.
// Throws Error on an index out of range or a covariance that is not positive definite.
BundleResult AdjustBundle(BundleProblem problem, const BundleOptions& options);

}  // namespace cohort
