#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <optional>

#include "datasets/readers/sequence.h"
#include "datasets/render/scene_geometry.h"

namespace cohort {

// The true position of a scene point in a frame.
struct TruePosition {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();  // [px]
  bool in_image = false;
  bool visible = false;  // in the image and not hidden
};

// The true paths of points: the error of a track is its distance from the path of the surface point
// at its first position. Queried frames are cached; not thread-safe.
class TrackTruth {
 public:
  // A scene point in this truth's representation.
  struct Anchor {
    FrameIndex frame{};
    Eigen::Vector3d x_in_world = Eigen::Vector3d::Zero();  // in that frame; rigid scenes: in all
    SurfacePoint on_surface;                               // of a rendered scene
  };

  virtual ~TrackTruth() = default;
  // The point at a pixel; nullopt if its depth is unknown or a foreground occluder hides the scene.
  virtual std::optional<Anchor> Pick(FrameIndex frame, const Eigen::Vector2d& xy) = 0;
  // Returns nullopt in a frame without a true pose, and behind the camera.
  virtual std::optional<TruePosition> Locate(const Anchor& anchor, FrameIndex frame) = 0;
  // Whether the depth jumps within `radius_px` of a pixel. Corners there are often not scene
  // points: a near edge crosses a far one. Steep surfaces and creases are not jumps. Unknown depth
  // counts as a jump.
  virtual bool IsOnDepthEdge(FrameIndex frame, const Eigen::Vector2d& xy, double radius_px) = 0;
};

// The best truth for `input`; `sequence` is `input`, and must outlive the result:
// - exact if it holds a scene.json, also for moving and deforming surfaces and a rolling shutter;
//   visible is the nearest surface on its ray, to 1 mm in 1 m; a jump is 2 % of the depth from
//   pixel to pixel;
// - else from depth pictures and true poses, for rigid scenes: depth between four neighbours that
//   agree to 2 %; visible where the depth picture agrees to 3 % + 2 cm; a jump is 5 %;
// - null without these. Masks of a foreground occluder count in both.
std::unique_ptr<TrackTruth> OpenTrackTruth(const Sequence& sequence,
                                           const std::filesystem::path& input);

}  // namespace cohort
