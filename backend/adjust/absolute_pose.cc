#include "backend/adjust/absolute_pose.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <vector>

#include "backend/scene/reprojection.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr double kMinPointDepth = 1e-6;

// Reweighted Gauss-Newton. The scale of the weights decreases with the median residual, so that all
// points still have influence if the start is off by many pixels.
Rigid3 Refine(std::span<const PointInFrame> points, const Rigid3& start, double max_error) {
  CameraPose pose{start.rotation.normalized(), start.Inverse().translation};
  std::vector<double> errors(points.size());
  std::vector<double> in_front;
  constexpr int kMaxIterations = 20;
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Eigen::Matrix3d rotation = pose.rotation.toRotationMatrix();
    in_front.clear();
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3d x = rotation * (points[i].in_world - pose.center);
      errors[i] = x.z() > kMinPointDepth ? (x.hnormalized() - points[i].n).norm() : -1.0;
      if (errors[i] >= 0.0) in_front.push_back(errors[i]);
    }
    if (in_front.size() < 4) break;
    const double c = std::max(2.0 * Median(in_front), 0.25 * max_error);

    Eigen::Matrix<double, 6, 6> H = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
    for (std::size_t i = 0; i < points.size(); ++i) {
      if (errors[i] < 0.0) continue;
      const NormalisedProjection p = ProjectNormalised(pose, points[i].in_world);
      const double w = 1.0 / (1.0 + errors[i] * errors[i] / (c * c));
      H.noalias() += w * p.d_pose.transpose() * p.d_pose;
      g.noalias() += w * p.d_pose.transpose() * (p.n - points[i].n);
    }
    const Eigen::Matrix<double, 6, 1> step = -H.ldlt().solve(g);
    if (!step.allFinite()) break;
    pose = MovedPose(pose, step);
    if (step.norm() < 1e-8) break;
  }
  return {pose.rotation, -(pose.rotation * pose.center)};
}

std::size_t CountInliers(std::span<const PointInFrame> points,
                         const Rigid3& cam_from_world,
                         double max_error) {
  const Eigen::Matrix3d rotation = cam_from_world.rotation.toRotationMatrix();
  std::size_t count = 0;
  for (const PointInFrame& point : points) {
    const Eigen::Vector3d x = rotation * point.in_world + cam_from_world.translation;
    if (x.z() > kMinPointDepth && (x.hnormalized() - point.n).norm() <= max_error) ++count;
  }
  return count;
}

std::optional<Rigid3> Ransac(std::span<const PointInFrame> points, double max_error) {
  std::vector<cv::Point3d> in_world;
  std::vector<cv::Point2d> n;
  for (const PointInFrame& point : points) {
    in_world.emplace_back(point.in_world.x(), point.in_world.y(), point.in_world.z());
    n.emplace_back(point.n.x(), point.n.y());
  }
  cv::UsacParams usac;
  usac.threshold = max_error;
  usac.confidence = 0.999;
  usac.maxIterations = 1000;
  usac.isParallel = false;  // the parallel version depends on timing
  usac.randomGeneratorState = 0;
  cv::Mat camera = cv::Mat::eye(3, 3, CV_64F);
  cv::Mat rotation_vector;
  cv::Mat translation_vector;
  if (!cv::solvePnPRansac(in_world,
                          n,
                          camera,
                          cv::noArray(),
                          rotation_vector,
                          translation_vector,
                          cv::noArray(),
                          usac)) {
    return std::nullopt;
  }
  Eigen::Vector3d omega;
  Eigen::Vector3d translation;
  cv::cv2eigen(rotation_vector, omega);
  cv::cv2eigen(translation_vector, translation);
  if (!omega.allFinite() || !translation.allFinite()) return std::nullopt;
  const double angle = omega.norm();
  Rigid3 result;
  if (angle > 0.0) result.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(angle, omega / angle));
  result.translation = translation;
  return result;
}

}  // namespace

std::optional<AbsolutePose> EstimateAbsolutePose(std::span<const PointInFrame> points,
                                                 const std::optional<Rigid3>& start,
                                                 double max_error,
                                                 double enough) {
  if (points.size() < 4) return std::nullopt;
  std::optional<AbsolutePose> best;
  const auto consider = [&](const Rigid3& candidate) {
    const Rigid3 refined = Refine(points, candidate, max_error);
    const std::size_t inliers = CountInliers(points, refined, max_error);
    if (!best || inliers > best->inliers) best = AbsolutePose{refined, inliers};
  };
  if (start) consider(*start);
  if (!best || static_cast<double>(best->inliers) < enough * static_cast<double>(points.size())) {
    if (const auto candidate = Ransac(points, max_error)) consider(*candidate);
  }
  return best;
}

}  // namespace cohort
