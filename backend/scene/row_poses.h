#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "backend/scene/reconstruction.h"

namespace cohort {

// Where a camera with a rolling shutter is when it exposes a row. Row y of a frame is exposed at
//   tau = readout ((y + 1/2) / height - 1/2)
// frame intervals after the middle row, whose pose is the frame's. Between frames the camera's
// centre and its rotation vector against the frame's follow the polynomial through those of the
// three nearest frames on each side (fewer at the ends of the clip; none beyond three frames away):
// with two, sways of 5 Hz and more are found too small.
class RowPoses {
 public:
  // Frames count from FrameIndex: a frame left out is two intervals.
  RowPoses(const std::map<FrameIndex, Rigid3>& cam_from_world, double readout, int height_px);

  // Of a frame with a pose; rows beyond the picture are as far away as its height goes.
  Rigid3 CamFromWorld(FrameIndex frame, double y) const;

  // Where the frame shows a point of the world: the xy whose row projects it to xy, by fixed-point
  // iteration. None behind the camera or where there is no such row.
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

  double readout_;
  double height_px_;
  std::map<FrameIndex, Motion> motions_;
};

}  // namespace cohort
