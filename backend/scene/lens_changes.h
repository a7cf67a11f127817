#pragma once

#include <map>
#include <optional>

#include "backend/scene/adjustment.h"
#include "backend/scene/focal_scale.h"
#include "backend/scene/reconstruction.h"
#include "frontend/geometry/rigid3.h"

namespace cohort {

// What the tracks of a model gain by a lens of its own for each frame. A zoom or an autofocus changes
// the focal length; a stabiliser that shifts the picture, as phones and editors have, changes the
// principal point. Both bend a model that has one camera, and leave it a small error.
struct LensChanges {
  FocalScales focal;  // of every frame, against the first
  // What goes with these focal lengths: the camera of the first frame, and the poses.
  Camera camera;
  std::map<FrameIndex, Rigid3> cam_from_world;
  double focal_gain = 0.0;    // share of the model's cost that these focal lengths take away
  double center_gain = 0.0;   // that a principal point for each frame takes away
  bool camera_known = false;  // the model's one camera was given, and so bends to nothing
  double shift_px = 0.0;      // how far these principal points lie apart

  // The tracks ask for a lens that changes.
  bool IsChanging() const;
  // Of both, the focal length takes more away.
  bool IsZoom() const { return focal_gain >= center_gain; }
};

// By bundle adjustments of at most 40 frames, evenly taken, and of some of their tracks, in which each
// frame has a focal length (a principal point) near that of the last. None: too few frames, or an
// adjustment failed.
std::optional<LensChanges> MeasureLensChanges(const WorkingModel& model,
                                              const CameraRefinement& refinement);

// Where a lens changes, of a model with one lens for all frames.
std::optional<Doubt> DescribeLensChanges(const LensChanges& changes);
// Of a model whose frames have focal lengths of their own: a zoom looks much like a way ahead.
Doubt DescribeFoundZoom(double zoom);

}  // namespace cohort
