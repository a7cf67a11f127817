#include "tests/support/synthetic_tracks.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "frontend/core/random_stream.h"

namespace cohort::test {
namespace {

using Eigen::Vector3d;

Rigid3 LookAt(const Vector3d& centre, const Vector3d& target) {
  const Vector3d z = (target - centre).normalized();
  const Vector3d x = Vector3d(0, 1, 0).cross(z).normalized();  // y points down
  Eigen::Matrix3d world_from_cam;
  world_from_cam << x, z.cross(x), z;
  return Rigid3{Eigen::Quaterniond(world_from_cam), centre}.Inverse();
}

// s runs from 0 to path_length over the clip. A little hand motion keeps the path off a line.
Rigid3 PoseOnPath(CameraPath path, double s) {
  const Vector3d wobble(
      0.06 * std::sin(9.0 * s), 0.08 * std::sin(7.0 * s + 1.0), 0.05 * std::cos(5.0 * s));
  const Eigen::Quaterniond tilt(
      Eigen::AngleAxisd(0.03 * std::sin(6.0 * s), Vector3d(1, 2, 1).normalized()));
  switch (path) {
    case CameraPath::kArc: {
      const double angle = (s - 0.5) * 40.0 / 180.0 * std::numbers::pi;
      const Vector3d centre(6.0 * std::sin(angle), 0.0, 6.0 - 6.0 * std::cos(angle));
      return LookAt(centre + wobble, {0, 0, 6});
    }
    case CameraPath::kLateral:
      return Rigid3{tilt, Vector3d(2.0 * s - 1.0, 0, 0) + wobble}.Inverse();
    case CameraPath::kForward:
      return Rigid3{tilt, Vector3d(0, 0, 2.5 * s) + wobble}.Inverse();
    case CameraPath::kRotation:
      return {tilt * Eigen::AngleAxisd(0.4 * (s - 0.5), Vector3d::UnitY()), Vector3d::Zero()};
    case CameraPath::kStatic:
      return {};
  }
  return {};
}

Vector3d RandomPoint(const SyntheticTracksOptions& options, RandomStream& random) {
  const CameraPath path = options.path;
  const double relief = options.plane_relief;
  const double x = random.Uniform(-1, 1);
  const double y = random.Uniform(-1, 1) * options.height;
  const double depth = random.Uniform(-1, 1) * relief;
  if (path == CameraPath::kArc) return {2.0 * x, 1.6 * y, 6.0 + 1.5 * depth};
  if (path == CameraPath::kForward) {
    const double z = 9.0 + 5.0 * depth;
    return {0.75 * x * z, 0.55 * y * z, z};
  }
  const double z = 6.5 + 2.5 * depth;
  return {x * z, 0.6 * y * z, z};
}

}  // namespace

Camera SyntheticTracksOptions::DefaultCamera() {
  Camera camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx = camera.fy = 500;
  camera.cx = 319.5;
  camera.cy = 239.5;
  return camera;
}

SyntheticTracks MakeSyntheticTracks(const SyntheticTracksOptions& options) {
  RandomStream scene(options.seed, "synthetic_tracks/scene");
  RandomStream noise(options.seed, "synthetic_tracks/noise");
  SyntheticTracks result;
  result.file.source = "synthetic";
  result.file.width_px = options.camera.width_px;
  result.file.height_px = options.camera.height_px;
  result.file.camera = options.camera;
  const auto frames = static_cast<std::uint32_t>(options.frames);
  for (std::uint32_t i = 0; i < frames; ++i) {
    const FrameIndex frame{options.first_frame + i * options.frame_stride};
    result.file.frames.push_back({frame,
                                  fmt::format("frame_{:06}.png", ToInt(frame)),
                                  std::int64_t{ToInt(frame)} * 33'333'333});
    const double s = options.path_length * (frames > 1 ? i / (frames - 1.0) : 0.5);
    result.cam_from_world[frame] = PoseOnPath(options.path, s);
  }
  std::vector<Observation> observations;
  for (int p = 0; p < options.points; ++p) {
    const FeatureId feature{static_cast<std::uint32_t>(3 * p + 2)};
    Vector3d point = RandomPoint(options, scene);
    const auto length = static_cast<std::int64_t>(
        options.max_track_length > 0 ? options.max_track_length : options.frames);
    const std::int64_t first =  // so that as many tracks are alive in each frame
        options.max_track_length > 0
            ? static_cast<std::int64_t>(scene.Below(frames + options.max_track_length)) - length
            : 0;
    if (options.path_length > 1.0) {  // beside the camera when it is seen
      const double middle = static_cast<double>(first) + 0.5 * static_cast<double>(length);
      point.x() += 2.0 * (options.path_length * middle / frames - 0.5);
    }
    Eigen::Vector2d drift = Eigen::Vector2d::Zero();
    for (std::int64_t i = 0; i < frames; ++i) {
      if (i < first || i >= first + length) continue;
      const FrameIndex frame = result.file.frames[static_cast<std::size_t>(i)].index;
      auto xy = options.camera.Project(result.cam_from_world.at(frame) * point);
      if (!xy || !options.camera.Contains(*xy)) continue;
      if (noise.Uniform() < options.missing_fraction) continue;
      if (options.drift_px > 0.0) {
        drift += options.drift_px * Eigen::Vector2d(noise.Gaussian(), noise.Gaussian());
      }
      xy->x() += drift.x() + options.noise_px * noise.Gaussian();
      xy->y() += drift.y() + options.noise_px * noise.Gaussian();
      if (noise.Uniform() < options.outlier_fraction) {
        *xy = {noise.Uniform(0, options.camera.width_px - 1),
               noise.Uniform(0, options.camera.height_px - 1)};
        result.outliers.insert({feature, frame});
      }
      Observation& o = observations.emplace_back();
      o.feature = feature;
      o.frame = frame;
      o.xy = *xy;
      result.points_in_world[feature] = point;
    }
  }
  result.file.tracks = TrackSet::Build(std::move(observations));
  return result;
}

double AbsoluteTrajectoryError(const std::map<FrameIndex, Rigid3>& estimate_cam_from_world,
                               const std::map<FrameIndex, Rigid3>& true_cam_from_world) {
  const auto n = static_cast<Eigen::Index>(estimate_cam_from_world.size());
  Eigen::Matrix3Xd estimate(3, n);
  Eigen::Matrix3Xd truth(3, n);
  Eigen::Index i = 0;
  for (const auto& [frame, cam_from_world] : estimate_cam_from_world) {
    estimate.col(i) = cam_from_world.Inverse().translation;
    truth.col(i) = true_cam_from_world.at(frame).Inverse().translation;
    ++i;
  }
  const Eigen::Matrix4d truth_from_estimate = Eigen::umeyama(estimate, truth, true);
  const Eigen::Matrix3Xd aligned =
      (truth_from_estimate * estimate.colwise().homogeneous()).topRows<3>();
  return std::sqrt((aligned - truth).colwise().squaredNorm().mean());
}

}  // namespace cohort::test
