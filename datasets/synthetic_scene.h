#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <vector>

#include "backend/geometry/camera.h"
#include "backend/geometry/rigid3.h"
#include "datasets/texture.h"
#include "frontend/core/options.h"
#include "frontend/tracks/observation.h"

namespace cohort {

enum class SceneName { kRoom, kCorridor, kStreet, kTabletop, kFacade, kShelves, kBodies, kCloth };
inline constexpr ChoiceNames<SceneName, 8> kSceneNames{{{"room", SceneName::kRoom},
                                                        {"corridor", SceneName::kCorridor},
                                                        {"street", SceneName::kStreet},
                                                        {"tabletop", SceneName::kTabletop},
                                                        {"facade", SceneName::kFacade},
                                                        {"shelves", SceneName::kShelves},
                                                        {"bodies", SceneName::kBodies},
                                                        {"cloth", SceneName::kCloth}}};

enum class Motion { kLateral, kForward, kOrbit };
inline constexpr ChoiceNames<Motion, 3> kMotionNames{
    {{"lateral", Motion::kLateral}, {"forward", Motion::kForward}, {"orbit", Motion::kOrbit}}};

struct SyntheticSceneOptions {
  SceneName scene = SceneName::kRoom;
  Motion motion = Motion::kLateral;
  int frames = 120;
  int width_px = 640;
  int height_px = 480;
  double focal_px = 525.0;
  unsigned seed = 1;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice("scene", o.scene, kSceneNames, "bodies: several move; cloth: one deforms; else rigid");
    v.Choice("motion", o.motion, kMotionNames, "of the hand-held camera");
    v.Number("frames", o.frames, 1, 100000, "at 30 a second");
    v.Number("width_px", o.width_px, 64, 8192, "of the pictures [px]");
    v.Number("height_px", o.height_px, 64, 8192, "of the pictures [px]");
    v.Number("focal_px", o.focal_px, 50.0, 20000.0, "focal length [px]");
    v.Number("seed", o.seed, 0U, 4294967295U, "of layout, textures and hand shake");
  }
};

// A point of the scene's surface: it moves with what it lies on.
struct SurfacePoint {
  std::size_t patch = 0;
  double s = 0.0;
  double t = 0.0;
};

// A scene of textured planar patches, 2-14 m away, seen by a hand-held camera. Everything follows
// from the options: rendering, depth and the true course of any surface point, also of moving and
// deforming ones. World: x right, y down, z ahead; metres.
class SyntheticScene {
 public:
  explicit SyntheticScene(const SyntheticSceneOptions& options);

  const SyntheticSceneOptions& options() const { return options_; }
  const Camera& camera() const { return camera_; }
  Rigid3 CamFromWorld(int frame) const;

  struct Rendering {
    cv::Mat image;  // CV_32FC1, 0..1; the mean of 3 x 3 samples a pixel
    cv::Mat depth;  // CV_32FC1, of the pixel's centre [m]; 0: nothing there
  };
  Rendering Render(int frame) const;

  // The scene as it stands in one frame, for many questions about it.
  class Moment;
  Moment At(int frame) const;

 private:
  // Points origin + s u + t v for s, t in 0..1 (a triangle: s + t <= 1).
  struct Patch {
    Eigen::Vector3d origin = Eigen::Vector3d::Zero();
    Eigen::Vector3d u = Eigen::Vector3d::Zero();
    Eigen::Vector3d v = Eigen::Vector3d::Zero();
    bool triangle = false;
    Eigen::Vector2d texture_origin = Eigen::Vector2d::Zero();  // [m]
    Eigen::Vector2d texture_u = Eigen::Vector2d::Zero();
    Eigen::Vector2d texture_v = Eigen::Vector2d::Zero();
    std::size_t texture = 0;
    double shade = 1.0;
    int body = 0;  // 0 stands still
  };
  class Builder;

  std::vector<Patch> PatchesAt(int frame) const;
  Rigid3 BodyMotion(int body, int frame) const;  // world_from_rest
  double ClothShift(double s, double t, int frame) const;

  SyntheticSceneOptions options_;
  Camera camera_;
  std::vector<Texture> textures_;
  std::vector<Patch> patches_;  // at rest
  int bodies_ = 0;
  int cloth_columns_ = 0;  // the last patches are the cloth's triangles, if any
  int cloth_rows_ = 0;
  std::size_t cloth_first_ = 0;
  Eigen::Vector3d cloth_origin_, cloth_u_, cloth_v_;
};

class SyntheticScene::Moment {
 public:
  // The surface point that a pixel shows; none where there is nothing.
  std::optional<SurfacePoint> Pick(const Eigen::Vector2d& xy) const;
  Eigen::Vector3d WorldPoint(const SurfacePoint& point) const;
  // Its pixel, also outside the picture; none behind the camera.
  std::optional<Eigen::Vector2d> Project(const SurfacePoint& point) const;
  double Depth(const SurfacePoint& point) const;  // along the optical axis [m]
  // Nothing of the scene lies between the camera and the point.
  bool IsUnobstructed(const SurfacePoint& point) const;

 private:
  friend class SyntheticScene;
  struct Hit {
    double depth;
    SurfacePoint point;
  };
  std::optional<Hit> Cast(const Eigen::Vector2d& xy) const;

  Camera camera_;
  Rigid3 cam_from_world_;
  std::vector<Patch> patches_;
};

// Called after each finished frame with (done, total).
using Progress = std::function<void(std::size_t, std::size_t)>;

// Renders a clip into a folder in TUM layout (rgb/, depth/, calibration.txt, groundtruth.txt,
// rgb.txt, depth.txt) with scene.json, from which the exact truth can be had again. Whole or not at
// all.
void RenderSequence(const SyntheticSceneOptions& options,
                    const std::filesystem::path& out,
                    const Progress& progress = {});

// scene.json of a folder; none if it has none. Throws Error if it cannot be understood.
std::optional<SyntheticSceneOptions> ReadSceneFile(const std::filesystem::path& folder);

}  // namespace cohort
