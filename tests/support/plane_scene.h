#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <vector>

#include "frontend/core/random_stream.h"
#include "frontend/geometry/camera.h"
#include "frontend/geometry/rigid3.h"
#include "tests/support/closed_form_image.h"

namespace cohort::test {

// A rigid scene in closed form: upright screens at several depths before a wall, seen by
// a camera that moves by a known path. Every pixel is the texture's value where its ray hits; there
// is no mesh and no texture picture. Intensities 0..1.
class PlaneScene {
 public:
  explicit PlaneScene(int width_px = 320, int height_px = 240) {
    camera_.width_px = width_px;
    camera_.height_px = height_px;
    camera_.fx = camera_.fy = 0.85 * width_px;
    camera_.cx = (width_px - 1) / 2.0;
    camera_.cy = (height_px - 1) / 2.0;
    screens_.push_back({7.0, -100.0, 100.0, 0.0});
    for (int i = 0; i < 4; ++i) {
      const double z = 2.6 + 0.7 * ((i * 3) % 4);
      const double x = -1.7 + 1.1 * i;
      screens_.push_back({z, x, x + 0.5, 37.0 * (i + 1)});
    }
  }

  const Camera& camera() const { return camera_; }

  // A hand-held path: 2 cm a frame to the side (or ahead), with shake.
  static Rigid3 CamFromWorld(int frame, bool forward = false) {
    const double t = frame;
    const Eigen::Vector3d shake(0.006 * std::sin(1.3 * t), 0.008 * std::sin(0.9 * t + 1), 0.0);
    const Eigen::Vector3d centre =
        (forward ? Eigen::Vector3d(0.002 * t, 0, 0.025 * t) : Eigen::Vector3d(0.02 * t, 0, 0)) +
        shake;
    const Eigen::Quaterniond rotation(
        Eigen::AngleAxisd(0.004 * std::sin(1.7 * t), Eigen::Vector3d::UnitX()) *
        Eigen::AngleAxisd(0.005 * std::sin(0.8 * t), Eigen::Vector3d::UnitY()) *
        Eigen::AngleAxisd(0.003 * std::sin(1.1 * t), Eigen::Vector3d::UnitZ()));
    return Rigid3{rotation, rotation * -centre};
  }

  cv::Mat Render(const Rigid3& cam_from_world) const {
    cv::Mat image(camera_.height_px, camera_.width_px, CV_32FC1);
    for (int y = 0; y < image.rows; ++y) {
      for (int x = 0; x < image.cols; ++x) {
        image.at<float>(y, x) = static_cast<float>(
            ValueAt(cam_from_world, {static_cast<double>(x), static_cast<double>(y)}));
      }
    }
    return image;
  }

  // The intensity of a pixel.
  double ValueAt(const Rigid3& cam_from_world, const Eigen::Vector2d& xy) const {
    const auto hit = Hit(cam_from_world, xy);
    return hit ? TextureAt(*hit) : 0.5;
  }

  // The world point that a pixel shows.
  std::optional<Eigen::Vector3d> PointAt(const Rigid3& cam_from_world,
                                         const Eigen::Vector2d& xy) const {
    const auto hit = Hit(cam_from_world, xy);
    if (!hit) return std::nullopt;
    return hit->point;
  }

  bool IsVisible(const Rigid3& cam_from_world, const Eigen::Vector3d& point) const {
    const auto xy = camera_.Project(cam_from_world * point);
    if (!xy || !camera_.Contains(*xy)) return false;
    const auto hit = Hit(cam_from_world, *xy);
    return hit && (hit->point - point).norm() < 0.02;
  }

 private:
  struct Screen {
    double z;
    double left;
    double right;
    double offset;  // into the texture, so that screens differ
  };
  struct SurfaceHit {
    Eigen::Vector3d point;
    const Screen* screen;
  };

  std::optional<SurfaceHit> Hit(const Rigid3& cam_from_world, const Eigen::Vector2d& xy) const {
    const Rigid3 world_from_cam = cam_from_world.Inverse();
    const Eigen::Vector3d direction = world_from_cam.rotation * camera_.Unproject(xy).homogeneous();
    std::optional<SurfaceHit> nearest;
    double nearest_distance = 1e9;
    for (const Screen& screen : screens_) {
      const double distance = (screen.z - world_from_cam.translation.z()) / direction.z();
      if (!(distance > 0.1) || distance >= nearest_distance) continue;
      const Eigen::Vector3d point = world_from_cam.translation + distance * direction;
      if (point.x() < screen.left || point.x() > screen.right) continue;
      nearest = SurfaceHit{point, &screen};
      nearest_distance = distance;
    }
    return nearest;
  }

  // As many spots a pixel near as far: the texture is laid out in pixels of the first frame.
  double TextureAt(const SurfaceHit& hit) const {
    const double scale = camera_.fx / hit.screen->z;
    return NoiseAt(320 + 0.8 * scale * hit.point.x() + hit.screen->offset,
                   240 + 0.8 * scale * hit.point.y() - 0.5 * hit.screen->offset);
  }

  Camera camera_;
  std::vector<Screen> screens_;
};

}  // namespace cohort::test
