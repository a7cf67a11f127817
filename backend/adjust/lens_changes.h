#pragma once

#include <map>
#include <optional>

#include "backend/adjust/adjustment.h"
#include "backend/scene/focal_scale.h"
#include "frontend/geometry/rigid3.h"

namespace cohort {

// How much better a model fits with a separate lens for each frame. A zoom or an autofocus changes
// the focal length; a stabiliser that shifts the picture, as phones and editors have, changes the
// principal point. Both bend a model that has one camera, while its error stays small.
struct LensChanges {
  FocalScales focal;  // of every frame, against the first
  // The camera of the first frame and the poses that belong to these focal lengths.
  Camera camera;
  std::map<FrameIndex, Rigid3> cam_from_world;
  double focal_gain = 0.0;    // share of the model's cost that these focal lengths remove
  double center_gain = 0.0;   // share that a principal point per frame removes
  bool camera_known = false;  // the model's camera was given, so it cannot adapt
  double shift_px = 0.0;      // the extent of these principal points

  // Whether the tracks imply a lens that changes.
  bool IsChanging() const;
  // Whether the focal length removes more of the cost than the principal point.
  bool IsZoom() const { return focal_gain >= center_gain; }
  // Whether a model that a zoom bent may cause these shifts.
  bool MayBeZoom() const;
};

// Bundle adjustments of at most 40 frames, evenly taken, and of some of their tracks, in which each
// frame has a focal length (a principal point) near that of the previous one. Returns nullopt if
// there are too few frames or an adjustment failed.
std::optional<LensChanges> MeasureLensChanges(const WorkingModel& model,
                                              const CameraRefinement& refinement);

}  // namespace cohort
