#include "backend/scene/row_poses.h"

#include <cmath>
#include <iterator>

namespace cohort {
namespace {

// Further away a neighbour says nothing of the motion.
constexpr double kMostFrames = 3.0;
constexpr int kNeighbours = 3;  // on each side

Eigen::Vector3d RotationVector(const Eigen::Quaterniond& rotation) {
  const Eigen::AngleAxisd turn(rotation);
  return turn.angle() * turn.axis();
}

Eigen::Quaterniond FromRotationVector(const Eigen::Vector3d& vector) {
  const double angle = vector.norm();
  if (angle < 1e-15) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, vector / angle));
}

}  // namespace

RowPoses::RowPoses(const std::map<FrameIndex, Rigid3>& cam_from_world,
                   double readout,
                   int height_px)
    : readout_(readout), height_px_(height_px) {
  for (auto it = cam_from_world.begin(); it != cam_from_world.end(); ++it) {
    Motion& motion = motions_[it->first];
    motion.cam_from_world = it->second;
    if (readout == 0.0) continue;
    motion.center = it->second.Inverse().translation;
    const auto add = [&](const auto& other) {
      const double frames =
          static_cast<double>(ToInt(other->first)) - static_cast<double>(ToInt(it->first));
      if (std::abs(frames) > kMostFrames) return;
      const Rigid3& there = other->second;
      motion.neighbours.push_back(
          {frames,
           there.Inverse().translation - motion.center,
           RotationVector(there.rotation * it->second.rotation.conjugate())});
    };
    auto before = it;
    for (int n = 0; n < kNeighbours && before != cam_from_world.begin(); ++n) add(--before);
    auto after = it;
    for (int n = 0; n < kNeighbours && ++after != cam_from_world.end(); ++n) add(after);
  }
}

Rigid3 RowPoses::CamFromWorld(FrameIndex frame, double y) const {
  const Motion& motion = motions_.at(frame);
  if (readout_ == 0.0) return motion.cam_from_world;
  const double tau = readout_ * ((y + 0.5) / height_px_ - 0.5);
  Eigen::Vector3d center = motion.center;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  for (const Neighbour& neighbour : motion.neighbours) {
    // Lagrange's polynomial of the neighbour, over the others and the frame itself (at 0, value 0).
    double weight = tau / neighbour.frames;
    for (const Neighbour& other : motion.neighbours) {
      if (&other != &neighbour) {
        weight *= (tau - other.frames) / (neighbour.frames - other.frames);
      }
    }
    center += weight * neighbour.center;
    turn += weight * neighbour.rotation;
  }
  const Eigen::Quaterniond rotation =
      (FromRotationVector(turn) * motion.cam_from_world.rotation).normalized();
  return {rotation, -(rotation * center)};
}

std::optional<Eigen::Vector2d> RowPoses::Project(const Camera& camera,
                                                 FrameIndex frame,
                                                 const Eigen::Vector3d& in_world) const {
  constexpr int kMostSteps = 20;
  constexpr double kSettledPx = 1e-6;
  double y = 0.5 * height_px_ - 0.5;
  for (int step = 0; step < kMostSteps; ++step) {
    auto xy = camera.Project(CamFromWorld(frame, y) * in_world);
    if (!xy) return std::nullopt;
    if (readout_ == 0.0 || std::abs(xy->y() - y) < kSettledPx) return xy;
    y = xy->y();
    // Far off the picture the parabola says nothing any more.
    if (!(std::abs(y) < 3.0 * height_px_)) return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace cohort
