#include "datasets/render/scene_geometry.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "datasets/render/scene_design.h"
#include "frontend/core/error.h"

namespace cohort {
namespace {

constexpr double kNearest = 0.02;  // [m]
constexpr int kTilePx = 16;
constexpr int kTileMarginPx = 64;

Camera PinholeCamera(const SyntheticSceneOptions& options) {
  Camera camera;
  camera.width_px = options.width_px;
  camera.height_px = options.height_px;
  camera.fx = camera.fy = options.focal_px;
  camera.cx = (options.width_px - 1) / 2.0;
  camera.cy = (options.height_px - 1) / 2.0;
  return camera;
}

}  // namespace

SyntheticScene::SyntheticScene(const SyntheticSceneOptions& options)
    : SyntheticScene(options, DesignScene(options.scene, options.seed, options.focal_px)) {}

SyntheticScene::SyntheticScene(const SyntheticSceneOptions& options, SceneDesign design)
    : options_(options),
      camera_(PinholeCamera(options)),
      design_(std::move(design)),
      path_(options.motion, design_.viewpoint, options.seed) {
  ValidateOptions(options);
  Triangulate();
}

void SyntheticScene::Triangulate() {
  for (std::size_t p = 0; p < patches().size(); ++p) {
    const Patch& patch = patches()[p];
    const std::size_t first = vertices_.size();
    first_vertex_.push_back(first);
    const auto columns = static_cast<std::size_t>(patch.columns);
    const auto rows = static_cast<std::size_t>(patch.rows);
    for (std::size_t row = 0; row <= rows; ++row) {
      for (std::size_t column = 0; column <= columns; ++column) {
        vertices_.emplace_back(static_cast<double>(column) / patch.columns,
                               static_cast<double>(row) / patch.rows);
        at_frame_zero_.push_back(patch.x_in_world(vertices_.back().x(), vertices_.back().y(), 0.0));
      }
    }
    for (std::size_t row = 0; row < rows; ++row) {
      for (std::size_t column = 0; column < columns; ++column) {
        const std::size_t a = first + row * (columns + 1) + column;
        const std::size_t b = a + columns + 1;
        triangles_.push_back({{a, a + 1, b}, p});
        triangles_.push_back({{b + 1, b, a + 1}, p});
      }
    }
  }
}

std::vector<Eigen::Vector3d> SyntheticScene::VerticesInWorld(double frame) const {
  std::vector<Eigen::Vector3d> result = at_frame_zero_;
  for (std::size_t p = 0; p < patches().size(); ++p) {
    if (!patches()[p].moves) continue;
    const std::size_t end = p + 1 < patches().size() ? first_vertex_[p + 1] : vertices_.size();
    for (std::size_t i = first_vertex_[p]; i < end; ++i) {
      result[i] = patches()[p].x_in_world(vertices_[i].x(), vertices_[i].y(), frame);
    }
  }
  return result;
}

std::optional<ProjectedTriangle> ProjectTriangle(const Camera& camera,
                                                 const std::array<Eigen::Vector3d, 3>& x_in_cam) {
  Check(!camera.HasDistortion(), "a rendering camera has no distortion");
  const double nearest = std::min({x_in_cam[0].z(), x_in_cam[1].z(), x_in_cam[2].z()});
  const double farthest = std::max({x_in_cam[0].z(), x_in_cam[1].z(), x_in_cam[2].z()});
  if (farthest < kNearest) return std::nullopt;
  // corners * (weights / depth) = ray, ray = K^-1 h.
  Eigen::Matrix3d corners;
  corners << x_in_cam[0], x_in_cam[1], x_in_cam[2];
  const double size = corners.cwiseAbs().maxCoeff();
  if (std::abs(corners.determinant()) < 1e-10 * size * size * size) return std::nullopt;
  Eigen::Matrix3d ray_from_pixel;
  ray_from_pixel << 1.0 / camera.fx, 0.0, -camera.cx / camera.fx,  //
      0.0, 1.0 / camera.fy, -camera.cy / camera.fy,                //
      0.0, 0.0, 1.0;
  ProjectedTriangle result;
  result.weights_by_depth = corners.inverse() * ray_from_pixel;
  result.inverse_depth = result.weights_by_depth.colwise().sum().transpose();
  result.tolerance = 1e-6 * result.weights_by_depth.leftCols<2>().cwiseAbs().maxCoeff();
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  result.left = result.top = nearest < kNearest ? -kInfinity : kInfinity;
  result.right = result.bottom = -result.left;
  if (nearest >= kNearest) {
    for (const Eigen::Vector3d& corner : x_in_cam) {
      const Eigen::Vector2d xy = *camera.Project(corner);
      result.left = std::min(result.left, xy.x());
      result.right = std::max(result.right, xy.x());
      result.top = std::min(result.top, xy.y());
      result.bottom = std::max(result.bottom, xy.y());
    }
  }
  return result;
}

SceneMoment::SceneMoment(const SyntheticScene& scene, double frame)
    : scene_(&scene),
      cam_from_world_(scene.CamFromWorld(frame)),
      vertices_in_world_(scene.VerticesInWorld(frame)),
      tile_columns_((scene.camera().width_px + 2 * kTileMarginPx) / kTilePx + 1),
      tile_rows_((scene.camera().height_px + 2 * kTileMarginPx) / kTilePx + 1),
      tiles_(static_cast<std::size_t>(tile_columns_ * tile_rows_)) {
  const auto tile = [](double px, int count) {
    const double at = std::floor((px + kTileMarginPx + 0.5) / kTilePx);
    return static_cast<int>(std::clamp(at, -1.0, static_cast<double>(count)));
  };
  for (std::size_t i = 0; i < scene.triangles().size(); ++i) {
    std::array<Eigen::Vector3d, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = cam_from_world_ * vertices_in_world_[scene.triangles()[i].vertices[k]];
    }
    const auto projected = ProjectTriangle(scene.camera(), corners);
    if (!projected) continue;
    const int left = std::max(0, tile(projected->left - 1.0, tile_columns_));
    const int right = std::min(tile_columns_ - 1, tile(projected->right + 1.0, tile_columns_));
    const int top = std::max(0, tile(projected->top - 1.0, tile_rows_));
    const int bottom = std::min(tile_rows_ - 1, tile(projected->bottom + 1.0, tile_rows_));
    if (left > right || top > bottom) continue;
    for (int row = top; row <= bottom; ++row) {
      for (int column = left; column <= right; ++column) {
        tiles_[static_cast<std::size_t>(row * tile_columns_ + column)].push_back(
            static_cast<std::uint32_t>(candidates_.size()));
      }
    }
    candidates_.push_back({*projected, i});
  }
}

SceneMoment::Hit SceneMoment::Cast(const Eigen::Vector2d& xy) const {
  const int column = static_cast<int>(std::floor((xy.x() + kTileMarginPx + 0.5) / kTilePx));
  const int row = static_cast<int>(std::floor((xy.y() + kTileMarginPx + 0.5) / kTilePx));
  Hit nearest;
  if (column < 0 || row < 0 || column >= tile_columns_ || row >= tile_rows_) return nearest;
  const Eigen::Vector3d pixel = xy.homogeneous();
  for (const std::uint32_t i : tiles_[static_cast<std::size_t>(row * tile_columns_ + column)]) {
    const Candidate& candidate = candidates_[i];
    const Eigen::Vector3d weights = candidate.projected.weights_by_depth * pixel;
    if (!candidate.projected.Covers(weights)) continue;
    if (const double inverse_depth = weights.sum(); inverse_depth > nearest.inverse_depth) {
      nearest = {&candidate, weights, inverse_depth};
    }
  }
  return nearest;
}

std::optional<SurfacePoint> SceneMoment::Pick(const Eigen::Vector2d& xy) const {
  const Hit hit = Cast(xy);
  if (hit.candidate == nullptr) return std::nullopt;
  return SurfacePoint{hit.candidate->triangle, hit.weights / hit.inverse_depth};
}

double SceneMoment::InverseDepth(const Eigen::Vector2d& xy) const { return Cast(xy).inverse_depth; }

Eigen::Vector3d SceneMoment::PointInWorld(const SurfacePoint& point) const {
  const SyntheticScene::Triangle& triangle = scene_->triangles()[point.triangle];
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    sum += point.weights[static_cast<Eigen::Index>(k)] * vertices_in_world_[triangle.vertices[k]];
  }
  return sum;
}

Eigen::Vector3d SceneMoment::PointInCam(const SurfacePoint& point) const {
  return cam_from_world_ * PointInWorld(point);
}

}  // namespace cohort
