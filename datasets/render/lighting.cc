#include "datasets/render/lighting.h"

#include <algorithm>
#include <cmath>

namespace cohort {
namespace {

constexpr double kReach = 0.7;  // distance within which an object blocks the ambient light [m]

}  // namespace

Lighting::Lighting(const SyntheticScene& scene)
    : design_(scene.design()), vertices_(scene.VerticesInWorld(0.0)) {
  for (const SyntheticScene::Triangle& triangle : scene.triangles()) {
    if (design_.patches[triangle.patch].moves) continue;
    const Eigen::Vector3d& a = vertices_[triangle.vertices[0]];
    blockers_.push_back(
        {a, vertices_[triangle.vertices[1]] - a, vertices_[triangle.vertices[2]] - a});
  }
}

cv::Mat Lighting::LightMap(const Patch& patch, RandomStream random) const {
  const auto cells = [](double length_m) {
    return std::clamp(static_cast<int>(std::lround(length_m / 0.1)), 3, 60);
  };
  Eigen::AlignedBox3d box;
  for (int row = 0; row < 8; ++row) {
    for (int column = 0; column < 8; ++column) {
      box.extend(patch.x_in_world(column / 7.0, row / 7.0, 0.0));
    }
  }
  const std::vector<Blocker> near = BlockersIn(box, kReach);
  const std::vector<Blocker> before_lamp =
      BlockersIn(Eigen::AlignedBox3d(box).extend(design_.lamp), LampSize());
  cv::Mat map(cells(patch.texture.height_m), cells(patch.texture.width_m), CV_32FC1);
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
      const double s = (x + 0.5) / map.cols;
      const double t = (y + 0.5) / map.rows;
      map.at<float>(y, x) = static_cast<float>(LightAt(patch, s, t, near, before_lamp, random));
    }
  }
  return map;
}

std::vector<Lighting::Blocker> Lighting::BlockersIn(const Eigen::AlignedBox3d& box,
                                                    double margin) const {
  std::vector<Blocker> result;
  for (const Blocker& b : blockers_) {
    const Eigen::AlignedBox3d reach =
        Eigen::AlignedBox3d(b.corner).extend(b.corner + b.u).extend(b.corner + b.v);
    if (box.squaredExteriorDistance(reach) <= margin * margin) result.push_back(b);
  }
  return result;
}

double Lighting::LightAt(const Patch& patch,
                         double s,
                         double t,
                         const std::vector<Blocker>& near,
                         const std::vector<Blocker>& before_lamp,
                         RandomStream& random) const {
  const double step = 1e-3;
  const Eigen::Vector3d x = patch.x_in_world(s, t, 0.0);
  const Eigen::Vector3d along_s = patch.x_in_world(s + step, t, 0.0) - x;
  const Eigen::Vector3d along_t = patch.x_in_world(s, t + step, 0.0) - x;
  Eigen::Vector3d normal = along_t.cross(along_s).normalized();
  // The side that faces the viewpoint.
  if (normal.dot(design_.viewpoint.centre - x) < 0.0) normal = -normal;
  const Eigen::Vector3d origin = x + 0.01 * normal;

  constexpr int kLampRays = 6;
  constexpr int kSkyRays = 10;
  const double scale2 = (design_.lamp - design_.viewpoint.target).squaredNorm() + 4.0;
  double direct = 0.0;
  for (int i = 0; i < kLampRays; ++i) {
    const double z = random.Uniform(-1, 1);
    const double y = random.Uniform(-1, 1);
    const Eigen::Vector3d jitter(random.Uniform(-1, 1), y, z);
    const Eigen::Vector3d to_lamp = design_.lamp + LampSize() * jitter - origin;
    const double cosine = normal.dot(to_lamp.normalized());
    if (cosine <= 0.0 || IsBlocked(before_lamp, origin, to_lamp)) continue;
    direct += cosine / (0.5 + to_lamp.squaredNorm() / scale2);
  }
  double open = 0.0;
  for (int i = 0; i < kSkyRays; ++i) {
    const double z = random.Gaussian();
    const double y = random.Gaussian();
    Eigen::Vector3d direction(random.Gaussian(), y, z);
    direction = (direction.normalized() + 1.01 * normal).normalized();  // cosine-weighted
    open += IsBlocked(near, origin, kReach * direction) ? 0.35 : 1.0;
  }
  return design_.ambient * open / kSkyRays + 1.2 * (1.0 - design_.ambient) * direct / kLampRays;
}

bool Lighting::IsBlocked(const std::vector<Blocker>& blockers,
                         const Eigen::Vector3d& origin,
                         const Eigen::Vector3d& way) {
  for (const Blocker& b : blockers) {
    const Eigen::Vector3d p = way.cross(b.v);
    const double det = b.u.dot(p);
    if (std::abs(det) < 1e-12) continue;
    const Eigen::Vector3d from = origin - b.corner;
    const double alpha = from.dot(p) / det;
    if (alpha < 0.0 || alpha > 1.0) continue;
    const Eigen::Vector3d q = from.cross(b.u);
    const double beta = way.dot(q) / det;
    if (beta < 0.0 || alpha + beta > 1.0) continue;
    const double at = b.v.dot(q) / det;
    if (at > 0.0 && at < 1.0) return true;
  }
  return false;
}

}  // namespace cohort
