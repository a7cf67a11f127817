#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "backend/scene/frame_times.h"
#include "backend/scene/reconstruction.h"

namespace cohort {

// Neighbours farther away do not contribute to a frame's motion.
inline constexpr double kMostFramesApart = 3.0;

// The pose of a rolling-shutter camera when it exposes a row of its sensor: a row of the picture,
// or a column of one that was turned upright (Camera::row_order). Row y of a frame is exposed at
//   tau = readout ((y + 1/2) / height - 1/2)
// frame intervals after the middle row, whose pose is the frame's. Between frames, the camera's
// centre and its rotation vector relative to the frame follow the polynomial through those of the
// three nearest frames on each side (fewer at the ends of the clip; none beyond three frames away).
// With two, sways of 5 Hz or more would be underestimated.
class RowPoses {
 public:
  // `times`: when the frames were taken, in the intervals that `readout` is a share of. Without
  // them frames are spaced by FrameIndex: a missing frame leaves a gap of two intervals.
  RowPoses(const std::map<FrameIndex, Rigid3>& cam_from_world,
           double readout,
           const Camera& camera,
           const FrameTimes& times = {});

  explicit RowPoses(const Reconstruction& model);

  // The pose of a frame for the row of xy; rows beyond the picture are extrapolated.
  Rigid3 CamFromWorld(FrameIndex frame, const Eigen::Vector2d& xy) const;

  // Projects a point of the world with that camera: finds the xy whose row projects the point to
  // xy, by fixed-point iteration. Returns nullopt behind the camera or if there is no such row.
  std::optional<Eigen::Vector2d> Project(const Camera& camera,
                                         FrameIndex frame,
                                         const Eigen::Vector3d& in_world) const;

 private:
  struct Neighbour {
    double frames;             // how much later
    Eigen::Vector3d center;    // less the frame's own
    Eigen::Vector3d rotation;  // vector of the rotation from the frame to it
  };
  struct Motion {
    Rigid3 cam_from_world;
    Eigen::Vector3d center;
    std::vector<Neighbour> neighbours;
  };

  double RowOf(const Eigen::Vector2d& xy) const;  // y, from -1/2 on, as the sensor counts
  Rigid3 OfRow(FrameIndex frame, double y) const;

  double readout_;
  RowOrder row_order_;
  double last_px_;  // the greatest y of a pixel
  std::map<FrameIndex, Motion> motions_;
};

}  // namespace cohort
