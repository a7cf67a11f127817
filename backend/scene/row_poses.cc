#include "backend/scene/row_poses.h"

#include <cmath>
#include <iterator>

namespace cohort {
namespace {

constexpr int kNeighbours = 3;  // on each side

bool AreColumns(RowOrder order) { return order == RowOrder::kLeft || order == RowOrder::kRight; }

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
                   const Camera& camera,
                   const FrameTimes& times)
    : readout_(readout),
      row_order_(camera.row_order),
      last_px_((AreColumns(camera.row_order) ? camera.width_px : camera.height_px) - 1.0) {
  for (auto it = cam_from_world.begin(); it != cam_from_world.end(); ++it) {
    Motion& motion = motions_[it->first];
    motion.cam_from_world = it->second;
    if (readout == 0.0) continue;
    motion.center = it->second.Inverse().translation;
    const auto add = [&](const auto& other) {
      const double frames = TimeOf(times, other->first) - TimeOf(times, it->first);
      if (std::abs(frames) > kMostFramesApart) return;
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

RowPoses::RowPoses(const Reconstruction& model)
    : RowPoses(model.cam_from_world, model.readout, model.camera, model.frame_times) {}

double RowPoses::RowOf(const Eigen::Vector2d& xy) const {
  switch (row_order_) {
    case RowOrder::kDown:
      return xy.y();
    case RowOrder::kUp:
      return last_px_ - xy.y();
    case RowOrder::kRight:
      return xy.x();
    case RowOrder::kLeft:
      return last_px_ - xy.x();
  }
  return xy.y();
}

Rigid3 RowPoses::CamFromWorld(FrameIndex frame, const Eigen::Vector2d& xy) const {
  return OfRow(frame, RowOf(xy));
}

Rigid3 RowPoses::OfRow(FrameIndex frame, double y) const {
  const Motion& motion = motions_.at(frame);
  if (readout_ == 0.0) return motion.cam_from_world;
  const double tau = readout_ * ((y + 0.5) / (last_px_ + 1.0) - 0.5);
  Eigen::Vector3d center = motion.center;
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  for (const Neighbour& neighbour : motion.neighbours) {
    // The neighbour's Lagrange polynomial over the other neighbours and the frame itself (at 0,
    // value 0).
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
  double y = 0.5 * last_px_;
  for (int step = 0; step < kMostSteps; ++step) {
    auto xy = camera.Project(OfRow(frame, y) * in_world);
    if (!xy) return std::nullopt;
    const double row = RowOf(*xy);
    if (readout_ == 0.0 || std::abs(row - y) < kSettledPx) return xy;
    y = row;
    // Far outside the picture the polynomial is meaningless.
    if (!(std::abs(y) < 3.0 * (last_px_ + 1.0))) return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace cohort
