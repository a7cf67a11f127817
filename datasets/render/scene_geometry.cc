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
constexpr double kRollingMarginPx = 4.0;  // by which a path within a frame may be curved

Camera PinholeCamera(const SyntheticSceneOptions& options) {
  Camera camera;
  camera.width_px = options.width_px;
  camera.height_px = options.height_px;
  camera.fx = camera.fy = options.focal_px;
  camera.cx = (options.width_px - 1) / 2.0;
  camera.cy = (options.height_px - 1) / 2.0;
  return camera;
}

bool IsNear(const ProjectedTriangle& around, const Eigen::Vector2d& xy) {
  return xy.x() >= around.left - kRollingMarginPx && xy.x() <= around.right + kRollingMarginPx &&
         xy.y() >= around.top - kRollingMarginPx && xy.y() <= around.bottom + kRollingMarginPx;
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

std::array<Eigen::Vector3d, 3> SyntheticScene::CornersInWorld(std::size_t triangle,
                                                              double frame) const {
  const Patch& patch = patches()[triangles_[triangle].patch];
  std::array<Eigen::Vector3d, 3> corners;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t vertex = triangles_[triangle].vertices[k];
    const Eigen::Vector2d& st = vertices_[vertex];
    corners[k] = patch.moves ? patch.x_in_world(st.x(), st.y(), frame) : at_frame_zero_[vertex];
  }
  return corners;
}

double SyntheticScene::TimeOfRow(double frame, double y) const {
  const double height = options_.height_px;
  const double row = std::clamp(y, -0.5, height - 0.5);
  return frame + options_.readout * ((row + 0.5) / height - 0.5);
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
      frame_(frame),
      cam_from_world_(scene.CamFromWorld(frame)),
      vertices_in_world_(scene.VerticesInWorld(frame)),
      tile_columns_((scene.camera().width_px + 2 * kTileMarginPx) / kTilePx + 1),
      tile_rows_((scene.camera().height_px + 2 * kTileMarginPx) / kTilePx + 1),
      tiles_(static_cast<std::size_t>(tile_columns_ * tile_rows_)) {
  for (std::size_t i = 0; i < scene.triangles().size(); ++i) AddCandidate(i);
}

std::optional<ProjectedTriangle> SceneMoment::Project(std::size_t triangle,
                                                      double time,
                                                      const Rigid3& cam_from_world) const {
  std::array<Eigen::Vector3d, 3> corners = scene_->CornersInWorld(triangle, time);
  for (Eigen::Vector3d& corner : corners) corner = cam_from_world * corner;
  return ProjectTriangle(scene_->camera(), corners);
}

// Adds it to the tiles that the triangle touches, with a rolling shutter at any time of the frame.
// Its path within a frame is almost straight, so a few times and a margin suffice.
void SceneMoment::AddCandidate(std::size_t triangle) {
  std::array<Eigen::Vector3d, 3> corners;
  for (std::size_t k = 0; k < 3; ++k) {
    corners[k] = cam_from_world_ * vertices_in_world_[scene_->triangles()[triangle].vertices[k]];
  }
  std::optional<ProjectedTriangle> around = ProjectTriangle(scene_->camera(), corners);
  const double margin_px = scene_->HasRollingShutter() ? kRollingMarginPx : 1.0;
  if (scene_->HasRollingShutter()) {
    const double height = scene_->camera().height_px;
    for (const double share : {0.0, 0.25, 0.75, 1.0}) {
      const double time = scene_->TimeOfRow(frame_, share * height - 0.5);
      const auto at = Project(triangle, time, scene_->CamFromWorld(time));
      if (!at) continue;
      if (!around) around = at;
      around->left = std::min(around->left, at->left);
      around->right = std::max(around->right, at->right);
      around->top = std::min(around->top, at->top);
      around->bottom = std::max(around->bottom, at->bottom);
    }
  }
  if (!around) return;
  const auto tile = [](double px, int count) {
    const double at = std::floor((px + kTileMarginPx + 0.5) / kTilePx);
    return static_cast<int>(std::clamp(at, -1.0, static_cast<double>(count)));
  };
  const int left = std::max(0, tile(around->left - margin_px, tile_columns_));
  const int right = std::min(tile_columns_ - 1, tile(around->right + margin_px, tile_columns_));
  const int top = std::max(0, tile(around->top - margin_px, tile_rows_));
  const int bottom = std::min(tile_rows_ - 1, tile(around->bottom + margin_px, tile_rows_));
  if (left > right || top > bottom) return;
  for (int row = top; row <= bottom; ++row) {
    for (int column = left; column <= right; ++column) {
      tiles_[row * tile_columns_ + column].push_back(
          static_cast<std::uint32_t>(candidates_.size()));
    }
  }
  candidates_.push_back({*around, triangle});
}

SceneMoment::Hit SceneMoment::Cast(const Eigen::Vector2d& xy) const {
  const int column = static_cast<int>(std::floor((xy.x() + kTileMarginPx + 0.5) / kTilePx));
  const int row = static_cast<int>(std::floor((xy.y() + kTileMarginPx + 0.5) / kTilePx));
  Hit nearest;
  if (column < 0 || row < 0 || column >= tile_columns_ || row >= tile_rows_) return nearest;
  const Eigen::Vector3d pixel = xy.homogeneous();
  const double time = scene_->TimeOfRow(frame_, xy.y());
  const Rigid3 cam_from_world =
      scene_->HasRollingShutter() ? scene_->CamFromWorld(time) : cam_from_world_;
  for (const std::uint32_t i : tiles_[row * tile_columns_ + column]) {
    const Candidate& candidate = candidates_[i];
    std::optional<ProjectedTriangle> at_row;
    if (scene_->HasRollingShutter()) {
      if (!IsNear(candidate.projected, xy)) continue;
      at_row = Project(candidate.triangle, time, cam_from_world);
      if (!at_row) continue;
    }
    const ProjectedTriangle& projected = at_row ? *at_row : candidate.projected;
    const Eigen::Vector3d weights = projected.weights_by_depth * pixel;
    if (!projected.Covers(weights)) continue;
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

std::optional<SceneMoment::Sight> SceneMoment::Locate(const SurfacePoint& point) const {
  Eigen::Vector3d x_in_cam = PointInCam(point);
  auto xy = scene_->camera().Project(x_in_cam);
  if (!xy || !scene_->HasRollingShutter()) {
    return xy ? std::optional(Sight{*xy, x_in_cam.z()}) : std::nullopt;
  }
  constexpr int kMaxIterations = 100;
  constexpr double kPrecisionPx = 1e-9;
  for (int i = 0; i < kMaxIterations; ++i) {
    const double y = xy->y();
    x_in_cam = PointInCamAt(point, scene_->TimeOfRow(frame_, y));
    xy = scene_->camera().Project(x_in_cam);
    if (!xy) return std::nullopt;
    if (std::abs(xy->y() - y) < kPrecisionPx) return Sight{*xy, x_in_cam.z()};
  }
  return std::nullopt;
}

Eigen::Vector3d SceneMoment::PointInCamAt(const SurfacePoint& point, double time) const {
  const std::array<Eigen::Vector3d, 3> corners = scene_->CornersInWorld(point.triangle, time);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 3; ++k) {
    sum += point.weights[static_cast<Eigen::Index>(k)] * corners[k];
  }
  return scene_->CamFromWorld(time) * sum;
}

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
