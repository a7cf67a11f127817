#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "datasets/render/camera_path.h"
#include "datasets/render/synthetic_scene.h"
#include "datasets/render/texture.h"
#include "frontend/geometry/camera.h"
#include "frontend/geometry/rigid3.h"

namespace cohort {

// A piece of surface, parametrised by two coordinates s, t in 0..1: a wall, a side of a box, a
// pipe, a cloth. It is a grid of columns x rows cells, each of two flat triangles.
struct Patch {
  using Shape = std::function<Eigen::Vector3d(double s, double t, double frame)>;
  Shape x_in_world;
  int columns = 1;
  int rows = 1;
  bool moves = false;  // the shape depends on the frame
  TextureSpec texture;
};

// The surfaces of a scene and its viewpoint.
struct SceneDesign {
  std::vector<Patch> patches;
  Viewpoint viewpoint;
  Eigen::Vector3d lamp{0.0, -1.0, 0.0};
  double ambient = 0.5;  // the ambient share of the light
};

// A point on the scene's surface, which moves with it.
struct SurfacePoint {
  std::size_t triangle = 0;
  Eigen::Vector3d weights = Eigen::Vector3d::Zero();  // of the triangle's corners, sum 1
};

// A scene of textured surfaces, mostly 2-9 m away, and the hand-held camera that looks at it. The
// options determine everything: pictures (render.h), depth, and the true path of every surface
// point, also of moving and deforming ones.
class SyntheticScene {
 public:
  struct Triangle {
    std::array<std::size_t, 3> vertices;
    std::size_t patch;
  };

  explicit SyntheticScene(const SyntheticSceneOptions& options);
  // With a custom design, for tests and experiments.
  SyntheticScene(const SyntheticSceneOptions& options, SceneDesign design);

  const SyntheticSceneOptions& options() const { return options_; }
  const Camera& camera() const { return camera_; }  // pinhole, centred
  // Also at a fraction of a frame.
  Rigid3 CamFromWorld(double frame) const { return path_.CamFromWorld(frame); }
  bool HasRollingShutter() const { return options_.readout > 0.0; }
  // The exposure time of row y of a frame, with y as of pixel centres; between rows too:
  //   frame + readout ((y + 1/2) / height - 1/2)
  // so that a frame's own time, and its true pose, are its middle row's. Clamped at the picture's
  // edges.
  double TimeOfRow(double frame, double y) const;

  const SceneDesign& design() const { return design_; }
  const std::vector<Patch>& patches() const { return design_.patches; }
  const std::vector<Triangle>& triangles() const { return triangles_; }
  const std::vector<Eigen::Vector2d>& vertices() const { return vertices_; }  // (s, t)
  std::vector<Eigen::Vector3d> VerticesInWorld(double frame) const;
  std::array<Eigen::Vector3d, 3> CornersInWorld(std::size_t triangle, double frame) const;

 private:
  void Triangulate();

  SyntheticSceneOptions options_;
  Camera camera_;
  SceneDesign design_;
  std::vector<Triangle> triangles_;
  std::vector<Eigen::Vector2d> vertices_;
  std::vector<std::size_t> first_vertex_;       // by patch
  std::vector<Eigen::Vector3d> at_frame_zero_;  // by vertex
  CameraPath path_;
};

// A triangle in a camera's view. With the homogeneous pixel h = (x, y, 1), weights_by_depth * h
// holds the barycentric weights divided by the depth: all are >= 0 inside, and their sum is the
// inverse depth. That needs no clipping (Olano and Greer, Triangle scan conversion using 2D
// homogeneous coordinates, 1997).
struct ProjectedTriangle {
  Eigen::Matrix3d weights_by_depth;
  Eigen::Vector3d inverse_depth;  // the sum of the rows
  // Its bounds [px]; the whole plane if it reaches behind the camera.
  double left, right, top, bottom;

  bool Covers(const Eigen::Vector3d& weights) const { return weights.minCoeff() >= -tolerance; }
  double tolerance;  // a millionth of a pixel: neighbours leave no gap
};
// Returns nullopt if the triangle is behind the camera or seen edge-on.
std::optional<ProjectedTriangle> ProjectTriangle(const Camera& camera,
                                                 const std::array<Eigen::Vector3d, 3>& x_in_cam);

// The scene in one frame, for queries about single points; with a rolling shutter every row has its
// own time.
class SceneMoment {
 public:
  // The view of a surface point in the frame.
  struct Sight {
    Eigen::Vector2d xy;  // [px], in the picture or not
    double depth;        // [m], along the optical axis of the camera that sees it
  };

  SceneMoment(const SyntheticScene& scene, double frame);

  // The nearest surface point on a pixel's ray; nullopt if there is none. Pixels may lie up to 64
  // px outside the picture.
  std::optional<SurfacePoint> Pick(const Eigen::Vector2d& xy) const;
  // The projection of a point, hidden or not; nullopt behind the camera. With a rolling shutter it
  // solves
  //   y = projection of the point at TimeOfRow(y),
  // by fixed-point iteration, which converges if the picture moves by less than its height in a
  // readout; nullopt if it does not converge.
  std::optional<Sight> Locate(const SurfacePoint& point) const;
  // At the frame's own time, which is the middle row's.
  Eigen::Vector3d PointInWorld(const SurfacePoint& point) const;
  Eigen::Vector3d PointInCam(const SurfacePoint& point) const;
  // 1 / depth along a pixel's ray [1/m]; 0 where there is nothing.
  double InverseDepth(const Eigen::Vector2d& xy) const;

  const Rigid3& cam_from_world() const { return cam_from_world_; }

 private:
  struct Candidate {
    ProjectedTriangle projected;  // rolling shutter: `left` to `bottom` are around it at all times
    std::size_t triangle;
  };
  struct Hit {
    const Candidate* candidate = nullptr;
    Eigen::Vector3d weights = Eigen::Vector3d::Zero();  // by depth
    double inverse_depth = 0.0;
  };
  void AddCandidate(std::size_t triangle);
  Hit Cast(const Eigen::Vector2d& xy) const;
  // The triangle's projection at another time of the frame.
  std::optional<ProjectedTriangle> Project(std::size_t triangle,
                                           double time,
                                           const Rigid3& cam_from_world) const;
  Eigen::Vector3d PointInCamAt(const SurfacePoint& point, double time) const;

  const SyntheticScene* scene_;
  double frame_;
  Rigid3 cam_from_world_;
  std::vector<Eigen::Vector3d> vertices_in_world_;
  std::vector<Candidate> candidates_;
  int tile_columns_;
  int tile_rows_;
  std::vector<std::vector<std::uint32_t>> tiles_;  // candidates that overlap it
};

}  // namespace cohort
