#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "backend/scene/reconstruction.h"

namespace cohort {

// A neighbour that is further away says nothing of a frame's motion.
inline constexpr double kMostFramesApart = 3.0;

// Where a camera with a rolling shutter is when it exposes a row of its sensor: a row of the picture,
// or a column of one that was turned upright (Camera::row_order). Row y of a frame is exposed at
//   tau = readout ((y + 1/2) / height - 1/2)
// frame intervals after the middle row, whose pose is the frame's. Between frames the camera's
// centre and its rotation vector against the frame's follow the polynomial through those of the
// three nearest frames on each side (fewer at the ends of the clip; none beyond three frames away):
// with two, sways of 5 Hz and more are found too small.
class RowPoses {
 public:
  // Frames count from FrameIndex: a frame left out is two intervals.
  RowPoses(const std::map<FrameIndex, Rigid3>& cam_from_world,
           double readout,
           const Camera& camera);

  // Of a frame with a pose, for the row that xy is in; rows beyond the picture are as far away as its
  // height goes.
  Rigid3 CamFromWorld(FrameIndex frame, const Eigen::Vector2d& xy) const;

  // Where the frame, of that camera, shows a point of the world: the xy whose row projects it to xy,
  // by fixed-point iteration. None behind the camera or where there is no such row.
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
