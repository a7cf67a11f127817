#include "backend/scene/bal.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <iterator>
#include <string>

#include "frontend/storage/output.h"

namespace cohort {

void WriteBal(const std::filesystem::path& path, const Reconstruction& reconstruction) {
  const Camera& camera = reconstruction.camera;
  const bool radial = camera.fx == camera.fy && camera.p1 == 0.0 && camera.p2 == 0.0 &&
                      camera.HasAtMostFourCoefficients();
  std::map<FrameIndex, std::size_t> number;
  for (const auto& [frame, pose] : reconstruction.cam_from_world) {
    number.emplace(frame, number.size());
  }
  std::string observations;
  std::string points;
  std::size_t observation_count = 0;
  std::size_t point_number = 0;
  for (const auto& [feature, point] : reconstruction.points) {
    for (const PointView& view : point.views) {
      const Camera of_frame = CameraOf(reconstruction, view.frame);
      const Eigen::Vector2d xy =
          radial ? Eigen::Vector2d(view.xy - Eigen::Vector2d(camera.cx, camera.cy))
                 : Eigen::Vector2d(of_frame.fx * of_frame.Unproject(view.xy));
      fmt::format_to(std::back_inserter(observations),
                     "{} {} {} {}\n",
                     number.at(view.frame),
                     point_number,
                     xy.x(),
                     -xy.y());
      ++observation_count;
    }
    fmt::format_to(std::back_inserter(points),
                   "{}\n{}\n{}\n",
                   point.in_world.x(),
                   point.in_world.y(),
                   point.in_world.z());
    ++point_number;
  }
  std::string text =
      fmt::format("{} {} {}\n", number.size(), point_number, observation_count) + observations;
  const Eigen::Quaterniond bal_from_cam(0, 1, 0, 0);  // half a turn about x
  for (const auto& [frame, cam_from_world] : reconstruction.cam_from_world) {
    const Eigen::AngleAxisd rotation(bal_from_cam * cam_from_world.rotation);
    const Eigen::Vector3d r = rotation.angle() * rotation.axis();
    const Eigen::Vector3d t = bal_from_cam * cam_from_world.translation;
    for (const double value : {r.x(),
                               r.y(),
                               r.z(),
                               t.x(),
                               t.y(),
                               t.z(),
                               CameraOf(reconstruction, frame).fx,
                               radial ? camera.k1 : 0.0,
                               radial ? camera.k2 : 0.0}) {
      fmt::format_to(std::back_inserter(text), "{}\n", value);
    }
  }
  OutputFile out(path);
  WriteBytes(out.partial(), text + points);
  out.Commit();
}

}  // namespace cohort
