#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <memory>
#include <optional>

#include "datasets/sequence.h"
#include "datasets/synthetic_scene.h"

namespace cohort {

// Where a point of the scene truly is in a frame.
struct TruePosition {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();  // [px]
  bool in_image = false;
  bool visible = false;  // in the image and hidden by nothing
};

// The true course of points: the error of a track is its distance from the course of the surface
// point that its first position shows.
class TrackTruth {
 public:
  // A point of the scene, as this truth names it.
  struct Anchor {
    FrameIndex frame{};
    Eigen::Vector3d in_world = Eigen::Vector3d::Zero();  // in that frame; rigid scenes: in all
    SurfacePoint on_surface;                             // of a rendered scene
  };

  virtual ~TrackTruth() = default;
  // The point that a pixel shows; none where its depth is unknown.
  virtual std::optional<Anchor> Pick(FrameIndex frame, const Eigen::Vector2d& xy) = 0;
  // None in a frame without a true pose, and behind the camera.
  virtual std::optional<TruePosition> Locate(const Anchor& anchor, FrameIndex frame) = 0;
  // Does the depth within `radius_px` of a pixel jump (by 3 %)? Corners there are no points of the
  // scene.
  virtual bool IsOnDepthEdge(FrameIndex frame, const Eigen::Vector2d& xy, double radius_px) = 0;
};

// The best truth that `input` has: exact where it holds a scene.json (moving and deforming bodies
// too), else from depth pictures and true poses (rigid scenes; depth interpolated where its four
// neighbours agree to 2 %; visible where the depth picture agrees to 2 % + 1 cm); none without
// these. `sequence` is `input`, opened without a frame range; it must outlive the result.
std::unique_ptr<TrackTruth> OpenTrackTruth(const Sequence& sequence,
                                           const std::filesystem::path& input);

}  // namespace cohort
