#include "datasets/render/camera_path.h"

#include <cmath>
#include <numbers>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr double kFps = 30.0;
constexpr double kHalfPeriodFrames = 160.0;
constexpr double kMiddleFrame = 60.0;

// The position on the path, in frames at full speed, after `frame` frames: a triangle wave with
// rounded corners.
double Travel(double frame) {
  constexpr double kSharpness = 0.985;
  constexpr double kStart = 13.0;  // past the rounded corner: at full speed from the first frame on
  const auto wave = [](double f) {
    const double angle = std::numbers::pi * (f / kHalfPeriodFrames - 0.5);
    return std::asin(kSharpness * std::sin(angle)) * kHalfPeriodFrames / std::numbers::pi;
  };
  return wave(frame + kStart) - wave(kStart);
}

template <typename Sines>
Eigen::Vector3d SumOfSines(const Sines& sines, double frame) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& sine : sines) {
    sum += sine.amplitude.cwiseProduct(
        (sine.radians_per_frame * frame + sine.phase.array()).sin().matrix());
  }
  return sum;
}

}  // namespace

CameraPath::CameraPath(Motion motion, const Viewpoint& viewpoint, std::uint64_t seed)
    : motion_(motion), viewpoint_(viewpoint) {
  const auto draw = [](RandomStream random, const Eigen::Vector3d& strength, auto& sines) {
    for (std::size_t i = 0; i < sines.size(); ++i) {
      const double hertz = 0.2 * std::pow(35.0, (static_cast<double>(i) + random.Uniform()) / 9.0);
      sines[i].radians_per_frame = 2.0 * std::numbers::pi * hertz / kFps;
      for (int axis = 0; axis < 3; ++axis) {
        sines[i].amplitude[axis] =
            strength[axis] * random.Uniform(0.5, 1.5) / std::pow(1.0 + 2.0 * hertz, 1.3);
        sines[i].phase[axis] = random.Uniform(0.0, 2.0 * std::numbers::pi);
      }
    }
  };
  const RandomStream random(seed, "scene/shake");
  draw(random.Fork(0), viewpoint.shake * Eigen::Vector3d(0.019, 0.022, 0.012), turn_);
  draw(random.Fork(1), viewpoint.shake * Eigen::Vector3d(0.020, 0.024, 0.016), shift_);
}

Rigid3 CameraPath::CamFromWorld(double frame) const {
  const double travel = viewpoint_.metres_per_frame * Travel(frame);
  const double from_middle = travel - viewpoint_.metres_per_frame * Travel(kMiddleFrame);
  const Eigen::Vector3d down = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d look = viewpoint_.target - viewpoint_.centre;
  const Eigen::Vector3d ahead = (look - look.dot(down) * down).normalized();
  const Eigen::Vector3d right = down.cross(ahead);

  Eigen::Vector3d centre = viewpoint_.centre;
  Eigen::Vector3d axis = look.normalized();
  switch (motion_) {
    case Motion::kLateral:
      centre += from_middle * right;
      break;
    case Motion::kForward:
      centre += travel * ahead;
      break;
    case Motion::kOrbit: {
      const Eigen::AngleAxisd turn(-from_middle / look.norm(), down);
      centre = viewpoint_.target - turn * look;
      axis = turn * axis;
      break;
    }
  }
  Eigen::Matrix3d world_from_cam;
  world_from_cam.col(2) = axis;
  world_from_cam.col(0) = down.cross(axis).normalized();
  world_from_cam.col(1) = axis.cross(world_from_cam.col(0));

  const Eigen::Vector3d turn = SumOfSines(turn_, frame);
  const double angle = turn.norm();
  const Eigen::Quaterniond shake = angle > 0.0
                                       ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle))
                                       : Eigen::Quaterniond::Identity();
  const Rigid3 pose{(Eigen::Quaterniond(world_from_cam) * shake).normalized(),
                    centre + SumOfSines(shift_, frame)};
  return pose.Inverse();
}

}  // namespace cohort
