#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "datasets/render/synthetic_scene.h"
#include "frontend/geometry/rigid3.h"

namespace cohort {

// Where a scene wants to be looked at from. World: x right, y down, z ahead, metres.
struct Viewpoint {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d target{0.0, 0.0, 4.5};
  double metres_per_frame = 0.02;
  double shake = 1.0;  // of the hand, times as strong; 0: a camera on rails
};

// A hand-held camera at 30 frames a second. It goes along its path at an even speed, turns back
// after some 145 frames, and so on: frame i is the same however many frames there are. Lateral
// passes the viewpoint in frame 60, looking ahead; forward starts there; orbit goes round the
// target. On top of it the hand shakes: sines of 0.2 to 7 Hz, strong where slow, in all six degrees
// of freedom.
class CameraPath {
 public:
  CameraPath(Motion motion, const Viewpoint& viewpoint, std::uint64_t seed);

  Rigid3 CamFromWorld(double frame) const;

 private:
  struct Sine {
    Eigen::Vector3d amplitude, phase;
    double radians_per_frame;
  };

  Motion motion_;
  Viewpoint viewpoint_;
  std::array<Sine, 9> turn_;   // [rad]
  std::array<Sine, 9> shift_;  // [m]
};

}  // namespace cohort
