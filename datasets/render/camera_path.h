#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "datasets/render/synthetic_scene.h"
#include "frontend/geometry/rigid3.h"

namespace cohort {

// The suitable viewpoint of a scene. World: x right, y down, z ahead, metres.
struct Viewpoint {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  Eigen::Vector3d target{0.0, 0.0, 4.5};
  double metres_per_frame = 0.02;
  double shake = 1.0;  // strength of the hand's shake; 0: a camera on rails
};

// A hand-held camera at 30 frames a second. It moves along its path at constant speed and reverses
// about every 145 frames, so that frame i does not depend on the number of frames. Lateral passes
// the viewpoint in frame 60, looking ahead; forward starts there; orbit moves around the target.
// The hand adds shake: sines of 0.2 to 7 Hz, strong where slow, in all six degrees of freedom.
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
