#include "backend/start/two_view_geometry.h"

#include <ceres/ceres.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "backend/geometry/best_rotation.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegreesPerRadian = 180.0 / std::numbers::pi;

Matrix3d PinholeMatrix(const Camera& camera) {
  Matrix3d k;
  k << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
  return k;
}

template <typename T>
Eigen::Matrix<T, 3, 3> CrossMatrix(const Eigen::Matrix<T, 3, 1>& t) {
  Eigen::Matrix<T, 3, 3> m;
  m << T(0), -t.z(), t.y(), t.z(), T(0), -t.x(), -t.y(), t.x(), T(0);
  return m;
}

// First-order distance of (x1, x2) in R^4 to the pairs with x2' F x1 = 0; signed.
template <typename T>
T Sampson(const Eigen::Matrix<T, 3, 3>& f, const Vector2d& x1, const Vector2d& x2) {
  const Eigen::Matrix<T, 3, 1> h1 = x1.homogeneous().template cast<T>();
  const Eigen::Matrix<T, 3, 1> h2 = x2.homogeneous().template cast<T>();
  const Eigen::Matrix<T, 3, 1> line2 = f * h1;
  const Eigen::Matrix<T, 3, 1> line1 = f.transpose() * h2;
  const T slope2 = line1.template head<2>().squaredNorm() + line2.template head<2>().squaredNorm();
  if (slope2 < T(1e-30)) return T(0);  // both at the epipoles
  return h2.dot(line2) / sqrt(slope2);
}

// The matches of a pair in undistorted pixels and as rays.
struct PairPoints {
  std::vector<Vector2d> px1, px2;
  std::vector<Vector3d> ray1, ray2;  // (nx, ny, 1)
  Matrix3d k = Matrix3d::Identity();
  Matrix3d k_inverse = Matrix3d::Identity();

  std::size_t size() const { return px1.size(); }
};

PairPoints Undistort(std::span<const Vector2d> xy1,
                     std::span<const Vector2d> xy2,
                     const Camera& camera) {
  PairPoints points;
  points.k = PinholeMatrix(camera);
  points.k_inverse = points.k.inverse();
  const auto add = [&](const Vector2d& xy, auto& px, auto& ray) {
    ray.push_back(camera.Unproject(xy).homogeneous());
    px.push_back((points.k * ray.back()).hnormalized());
  };
  for (std::size_t i = 0; i < xy1.size(); ++i) {
    add(xy1[i], points.px1, points.ray1);
    add(xy2[i], points.px2, points.ray2);
  }
  return points;
}

cv::Mat AsCvPoints(const std::vector<Vector2d>& points) {
  cv::Mat m(static_cast<int>(points.size()), 1, CV_64FC2);
  for (int i = 0; i < m.rows; ++i) {
    m.at<cv::Vec2d>(i) = {points[static_cast<std::size_t>(i)].x(),
                          points[static_cast<std::size_t>(i)].y()};
  }
  return m;
}

cv::UsacParams RobustParameters(double threshold) {
  cv::UsacParams params;
  params.threshold = threshold;
  params.confidence = 0.9999;
  params.maxIterations = 2000;
  params.sampler = cv::SAMPLING_UNIFORM;
  params.score = cv::SCORE_METHOD_MAGSAC;
  params.loMethod = cv::LOCAL_OPTIM_SIGMA;
  params.isParallel = false;  // the parallel version depends on timing
  params.randomGeneratorState = 0;
  return params;
}

std::optional<Matrix3d> AsMatrix3(const cv::Mat& m) {
  if (m.rows != 3 || m.cols != 3) return std::nullopt;  // OpenCV: empty when nothing was found
  Matrix3d result;
  cv::cv2eigen(m, result);
  if (!result.allFinite() || result.norm() < 1e-12) return std::nullopt;
  return result;
}

std::optional<Matrix3d> RobustEssential(const PairPoints& points, double max_error_px) {
  std::vector<Vector2d> n1(points.size()), n2(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    n1[i] = points.ray1[i].head<2>();
    n2[i] = points.ray2[i].head<2>();
  }
  const double focal_px = 0.5 * (points.k(0, 0) + points.k(1, 1));
  const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat mask;
  return AsMatrix3(cv::findEssentialMat(AsCvPoints(n1),
                                        AsCvPoints(n2),
                                        identity,
                                        identity,
                                        cv::noArray(),
                                        cv::noArray(),
                                        mask,
                                        RobustParameters(max_error_px / focal_px)));
}

std::optional<Matrix3d> RobustFundamental(const PairPoints& points, double max_error_px) {
  cv::Mat mask;
  return AsMatrix3(cv::findFundamentalMat(
      AsCvPoints(points.px1), AsCvPoints(points.px2), mask, RobustParameters(max_error_px)));
}

std::optional<Matrix3d> RobustHomography(const PairPoints& points, double max_error_px) {
  cv::Mat mask;
  return AsMatrix3(cv::findHomography(
      AsCvPoints(points.px1), AsCvPoints(points.px2), mask, RobustParameters(max_error_px)));
}

double TransferError(const Matrix3d& h, const Vector2d& x1, const Vector2d& x2) {
  const Vector3d y = h * x1.homogeneous();
  return std::abs(y.z()) < 1e-12 ? std::numeric_limits<double>::infinity()
                                 : (y.hnormalized() - x2).norm();
}

std::vector<bool> FundamentalInliers(const PairPoints& points,
                                     const Matrix3d& f,
                                     double max_error_px) {
  std::vector<bool> inlier(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    inlier[i] = std::abs(Sampson(f, points.px1[i], points.px2[i])) < max_error_px;
  }
  return inlier;
}

// Of the depths l1, l2 in l2 ray2 = l1 R ray1 + t.
bool InFrontOfBoth(const Rigid3& cam2_from_cam1, const Vector3d& ray1, const Vector3d& ray2) {
  const Vector3d a = cam2_from_cam1.rotation * ray1;
  const Vector3d& t = cam2_from_cam1.translation;
  const Vector3d n = a.cross(ray2);
  return n.dot(ray2.cross(t)) > 0.0 && n.dot(a.cross(t)) > 0.0;
}

// Of the four poses of an essential matrix the one that has most matches in front of both cameras.
Rigid3 PoseFromEssential(const Matrix3d& essential,
                         const PairPoints& points,
                         const std::vector<bool>& use) {
  const Eigen::JacobiSVD<Matrix3d> svd(essential, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d u = svd.matrixU();
  Matrix3d v = svd.matrixV();
  if (u.determinant() < 0) u.col(2) *= -1.0;
  if (v.determinant() < 0) v.col(2) *= -1.0;
  Matrix3d w;
  w << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  Rigid3 best;
  int most = -1;
  for (const Matrix3d& r :
       {Matrix3d(u * w * v.transpose()), Matrix3d(u * w.transpose() * v.transpose())}) {
    for (const double sign : {1.0, -1.0}) {
      const Rigid3 pose{Eigen::Quaterniond(r).normalized(), sign * u.col(2)};
      int in_front = 0;
      for (std::size_t i = 0; i < points.size(); ++i) {
        if (use[i] && InFrontOfBoth(pose, points.ray1[i], points.ray2[i])) ++in_front;
      }
      if (in_front > most) {
        most = in_front;
        best = pose;
      }
    }
  }
  return best;
}

struct SampsonCost {
  Vector2d x1, x2;
  Matrix3d k_inverse;

  template <typename T>
  bool operator()(const T* rotation, const T* translation, T* residual) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q(rotation);
    const Eigen::Matrix<T, 3, 1> t(translation[0], translation[1], translation[2]);
    const Eigen::Matrix<T, 3, 3> k_inv = k_inverse.cast<T>();
    const Eigen::Matrix<T, 3, 3> f =
        k_inv.transpose() * CrossMatrix<T>(t) * q.toRotationMatrix() * k_inv;
    residual[0] = Sampson<T>(f, x1, x2);
    return true;
  }
};

// Minimises the robust sum of squared Sampson distances over the rotation and the direction of
// translation: a RANSAC's five points are a start, all matches together are the estimate.
Rigid3 RefinePose(const Rigid3& start,
                  const PairPoints& points,
                  const std::vector<bool>& use,
                  double max_error_px) {
  Rigid3 pose = start;
  ceres::Problem problem;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!use[i]) continue;
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<SampsonCost, 1, 4, 3>(
                                 new SampsonCost{points.px1[i], points.px2[i], points.k_inverse}),
                             new ceres::CauchyLoss(0.25 * max_error_px),
                             pose.rotation.coeffs().data(),
                             pose.translation.data());
  }
  problem.SetManifold(pose.rotation.coeffs().data(), new ceres::EigenQuaternionManifold);
  problem.SetManifold(pose.translation.data(), new ceres::SphereManifold<3>);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 20;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  if (!summary.IsSolutionUsable()) return start;
  return pose;
}

// The rotation with ray2 ~ R ray1 of the matches in use.
Matrix3d RotationBetween(const PairPoints& points, const std::vector<bool>& use) {
  std::vector<std::pair<Vector2d, Vector2d>> pairs;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (use[i]) pairs.emplace_back(points.ray1[i].head<2>(), points.ray2[i].head<2>());
  }
  return FitRotation(pairs).target_from_source.toRotationMatrix();
}

template <typename Value>
double QuantileOfInliers(const TwoViewGeometry& geometry, double share, const Value& value) {
  std::vector<double> values;
  values.reserve(geometry.inlier_count);
  for (std::size_t i = 0; i < geometry.inlier.size(); ++i) {
    if (geometry.inlier[i]) values.push_back(value(i));
  }
  return Quantile(std::move(values), share);
}

template <typename Value>
double MedianOfInliers(const TwoViewGeometry& geometry, const Value& value) {
  return QuantileOfInliers(geometry, 0.5, value);
}

std::size_t Count(const std::vector<bool>& inlier) {
  return static_cast<std::size_t>(std::count(inlier.begin(), inlier.end(), true));
}

// By E, or by F where the focal length is a guess.
std::optional<Matrix3d> RobustFundamentalOf(const PairPoints& points,
                                            bool camera_known,
                                            double max_error_px) {
  if (!camera_known) return RobustFundamental(points, max_error_px);
  const auto essential = RobustEssential(points, max_error_px);
  if (!essential) return std::nullopt;
  return Matrix3d(points.k_inverse.transpose() * *essential * points.k_inverse);
}

// What the epipolar geometry says of a pair, and which matches agree with it.
struct EpipolarFit {
  Matrix3d fundamental;
  Rigid3 pose;  // cam2_from_cam1, |translation| = 1
  std::vector<bool> inlier;
};

// None where fewer than min_inliers matches agree.
std::optional<EpipolarFit> FitEpipolarGeometry(const PairPoints& points,
                                               bool camera_known,
                                               const TwoViewOptions& options) {
  const auto min_inliers = static_cast<std::size_t>(options.min_inliers);
  const auto robust = RobustFundamentalOf(points, camera_known, options.max_error_px);
  if (!robust) return std::nullopt;
  EpipolarFit fit{*robust, {}, FundamentalInliers(points, *robust, options.max_error_px)};
  if (Count(fit.inlier) < min_inliers) return std::nullopt;

  fit.pose =
      PoseFromEssential(points.k.transpose() * fit.fundamental * points.k, points, fit.inlier);
  fit.pose = RefinePose(fit.pose, points, fit.inlier, options.max_error_px);
  if (!camera_known) return fit;
  fit.fundamental = points.k_inverse.transpose() * EssentialFromPose(fit.pose) * points.k_inverse;
  fit.inlier = FundamentalInliers(points, fit.fundamental, options.max_error_px);
  // A match behind a camera contradicts the geometry, unless noise of a far point put it there.
  const Matrix3d infinite = points.k * fit.pose.rotation.toRotationMatrix() *
                            points.k_inverse;  // x2 of a point at infinity
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (fit.inlier[i] && !InFrontOfBoth(fit.pose, points.ray1[i], points.ray2[i]) &&
        TransferError(infinite, points.px1[i], points.px2[i]) > options.max_error_px) {
      fit.inlier[i] = false;
    }
  }
  if (Count(fit.inlier) < min_inliers) return std::nullopt;
  return fit;
}

// With the medians over the inliers. `rotated` takes pixels as the inliers' best rotation does.
TwoViewGeometry WithMedians(TwoViewGeometry geometry,
                            const PairPoints& points,
                            const EpipolarFit& fit,
                            const Matrix3d& rotated) {
  geometry.error_px = MedianOfInliers(geometry, [&](std::size_t i) {
    return std::abs(Sampson(fit.fundamental, points.px1[i], points.px2[i]));
  });
  geometry.motion_px = MedianOfInliers(
      geometry, [&](std::size_t i) { return (points.px2[i] - points.px1[i]).norm(); });
  geometry.parallax_px = MedianOfInliers(geometry, [&](std::size_t i) {
    return TransferError(rotated, points.px1[i], points.px2[i]);
  });
  geometry.angle_deg = MedianOfInliers(geometry, [&](std::size_t i) {
    const Vector3d a = fit.pose.rotation * points.ray1[i];
    return std::atan2(a.cross(points.ray2[i]).norm(), a.dot(points.ray2[i])) * kDegreesPerRadian;
  });
  return geometry;
}

struct HomographyFit {
  std::optional<Matrix3d> matrix;  // |H| = 1; none: it explains fewer than min_inliers
  double ratio = 0.0;              // share of the inliers that it explains
  double error_px = std::numeric_limits<double>::infinity();  // 80th percentile over the inliers
};
HomographyFit FitHomography(const PairPoints& points,
                            const TwoViewGeometry& geometry,
                            const TwoViewOptions& options) {
  HomographyFit fit;
  const auto h = RobustHomography(points, options.max_error_px);
  if (!h) return fit;
  std::size_t explained = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (geometry.inlier[i] &&
        TransferError(*h, points.px1[i], points.px2[i]) < options.max_error_px) {
      ++explained;
    }
  }
  if (explained < static_cast<std::size_t>(options.min_inliers)) return fit;
  fit.matrix = *h / h->norm();
  fit.ratio = static_cast<double>(explained) / static_cast<double>(geometry.inlier_count);
  fit.error_px = QuantileOfInliers(geometry, 0.8, [&](std::size_t i) {
    return TransferError(*h, points.px1[i], points.px2[i]);
  });
  return fit;
}

// A rotation alone explains the pair: no depth, no translation.
TwoViewGeometry AsPanoramic(TwoViewGeometry geometry,
                            const PairPoints& points,
                            const Matrix3d& rotated,
                            double max_error_px) {
  geometry.kind = TwoViewKind::kPanoramic;
  geometry.angle_deg = 0.0;
  geometry.homography = rotated;
  for (std::size_t i = 0; i < points.size(); ++i) {
    geometry.inlier[i] =
        geometry.inlier[i] && TransferError(rotated, points.px1[i], points.px2[i]) < max_error_px;
  }
  geometry.inlier_count = Count(geometry.inlier);
  return geometry;
}

}  // namespace

FramePairMatches MatchFrames(const TrackSet& tracks, FrameIndex frame1, FrameIndex frame2) {
  const auto in1 = tracks.InFrame(frame1);
  const auto in2 = tracks.InFrame(frame2);
  FramePairMatches matches;
  for (auto a = in1.begin(), b = in2.begin(); a != in1.end() && b != in2.end();) {
    if ((*a)->feature < (*b)->feature) {
      ++a;
    } else if ((*b)->feature < (*a)->feature) {
      ++b;
    } else {
      if (IsObserved(**a) && IsObserved(**b)) {
        matches.features.push_back((*a)->feature);
        matches.xy1.push_back((*a)->xy);
        matches.xy2.push_back((*b)->xy);
      }
      ++a;
      ++b;
    }
  }
  return matches;
}

TwoViewGeometry EstimateTwoViewGeometry(
    const WhitenedTracks& whitened, int frame_a, int frame_b, Camera camera, double max_error_px) {
  std::vector<Vector2d> xy_a;
  std::vector<Vector2d> xy_b;
  for (const auto& [a, b] : whitened.CommonObservations(frame_a, frame_b)) {
    xy_a.push_back(whitened.observations()[a].xy);
    xy_b.push_back(whitened.observations()[b].xy);
  }
  camera.known = true;
  return EstimateTwoViewGeometry(
      xy_a, xy_b, camera, {.max_error_px = max_error_px, .min_inliers = 8});
}

Matrix3d EssentialFromPose(const Rigid3& cam2_from_cam1) {
  return CrossMatrix<double>(cam2_from_cam1.translation) *
         cam2_from_cam1.rotation.toRotationMatrix();
}

TwoViewGeometry EstimateTwoViewGeometry(std::span<const Vector2d> xy1,
                                        std::span<const Vector2d> xy2,
                                        const Camera& camera,
                                        const TwoViewOptions& options) {
  if (xy1.size() != xy2.size()) {
    ThrowError(
        "two-view geometry: {} positions in one frame and {} in the other", xy1.size(), xy2.size());
  }
  TwoViewGeometry geometry;
  geometry.inlier.assign(xy1.size(), false);
  const auto min_inliers = static_cast<std::size_t>(options.min_inliers);
  if (xy1.size() < min_inliers) return geometry;

  const PairPoints points = Undistort(xy1, xy2, camera);
  const std::optional<EpipolarFit> fit = FitEpipolarGeometry(points, camera.known, options);
  if (!fit) return geometry;
  geometry.inlier = fit->inlier;
  geometry.inlier_count = Count(fit->inlier);

  const Matrix3d rotated = points.k * RotationBetween(points, fit->inlier) * points.k_inverse;
  geometry = WithMedians(std::move(geometry), points, *fit, rotated);
  const HomographyFit homography = FitHomography(points, geometry, options);
  geometry.homography = homography.matrix;
  geometry.homography_ratio = homography.ratio;

  // Pure noise of s px a coordinate leaves a median Sampson distance of 0.67 s, a median transfer
  // error of 1.67 s and an 80th percentile of 2.54 s: ratios of 2.5 and 3.8. Beyond 4 and 6 there
  // is something that a rotation or a homography does not explain. (The percentile, because what
  // tells a scene from a plane may be a minority of near points.) A wrong focal length leaves some
  // of a rotation unexplained.
  const double error_px = std::max(geometry.error_px, 0.05);
  const double unexplained_px =
      camera.known ? 4.0 * error_px : std::max(4.0 * error_px, 0.05 * geometry.motion_px);
  if (geometry.parallax_px < unexplained_px) {
    return AsPanoramic(
        std::move(geometry), points, rotated, std::max(options.max_error_px, unexplained_px));
  }
  geometry.cam2_from_cam1 = fit->pose;
  geometry.essential = EssentialFromPose(fit->pose);
  geometry.fundamental = fit->fundamental / fit->fundamental.norm();
  if (homography.error_px < 6.0 * error_px) {
    geometry.kind = TwoViewKind::kPlanar;
  } else {
    geometry.kind = camera.known ? TwoViewKind::kCalibrated : TwoViewKind::kUncalibrated;
  }
  return geometry;
}

}  // namespace cohort
