#include "backend/scene/near_world.h"

#include <Eigen/Core>
#include <cmath>
#include <utility>
#include <vector>

namespace cohort {

std::optional<Sim3> NearFromWorld(const std::map<FrameIndex, Rigid3>& cam_from_world) {
  // Very conservative: models of the mapper, and of other programs that normalise, stay bit for
  // bit.
  constexpr double kFarOff = 100.0;  // in units of the cameras' extent
  constexpr double kSmallest = 1e-4;
  constexpr double kLargest = 1e4;
  // As a share of the distance from the origin: a smaller extent is rounding of a single position.
  constexpr double kRounding = 1e-12;
  if (cam_from_world.empty()) return std::nullopt;
  std::vector<Eigen::Vector3d> centers;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const auto& [frame, pose] : cam_from_world) {
    centers.push_back(pose.Inverse().translation);
    mean += centers.back() / static_cast<double>(cam_from_world.size());
  }
  double squares = 0.0;
  for (const Eigen::Vector3d& center : centers) squares += (center - mean).squaredNorm();
  const double extent = std::sqrt(squares / static_cast<double>(centers.size()));
  if (!(extent > kRounding * mean.norm())) return std::nullopt;
  if (mean.norm() <= kFarOff * extent && extent >= kSmallest && extent <= kLargest) {
    return std::nullopt;
  }
  return Sim3{1.0 / extent, Eigen::Quaterniond::Identity(), -mean / extent};
}

Reconstruction MoveWorld(const Sim3& target_from_world, Reconstruction reconstruction) {
  for (auto& [frame, pose] : reconstruction.cam_from_world) {
    pose = TransformPose(target_from_world, pose);
  }
  for (auto& [feature, point] : reconstruction.points) {
    point.in_world = target_from_world * point.in_world;
  }
  return reconstruction;
}

NearModel::NearModel(const Reconstruction& model)
    : model_(model), near_from_world_(NearFromWorld(model.cam_from_world)) {
  if (near_from_world_) moved_ = MoveWorld(*near_from_world_, model);
}

Reconstruction NearModel::InWorldOfModel(Reconstruction made) const {
  if (!near_from_world_) return made;
  return MoveWorld(near_from_world_->Inverse(), std::move(made));
}

}  // namespace cohort
