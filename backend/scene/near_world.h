#pragma once

#include <map>
#include <optional>

#include "backend/scene/reconstruction.h"
#include "frontend/geometry/rigid3.h"
#include "frontend/geometry/sim3.h"

namespace cohort {

// A georeferenced model has coordinates of millions of metres. Their squares, as in triangulation
// and adjustment, lose the digits of the distances between the cameras. Bounds on depths also
// assume worlds of about unit scale.
//
// Returns the similarity that moves such cameras so that their mean centre is the origin and their
// root mean square distance from it is 1. Returns nullopt if they are near enough; nothing changes
// then.
std::optional<Sim3> NearFromWorld(const std::map<FrameIndex, Rigid3>& cam_from_world);

// Cameras and points in another world.
Reconstruction MoveWorld(const Sim3& target_from_world, Reconstruction reconstruction);

// A model moved by NearFromWorld, and the way back. `model` must outlive it: a model that is near
// enough is not copied.
class NearModel {
 public:
  explicit NearModel(const Reconstruction& model);

  const Reconstruction& get() const { return moved_ ? *moved_ : model_; }
  // Moves a result derived from it back into the world of `model`.
  Reconstruction InWorldOfModel(Reconstruction made) const;
  bool IsMoved() const { return moved_.has_value(); }

 private:
  const Reconstruction& model_;
  std::optional<Sim3> near_from_world_;
  std::optional<Reconstruction> moved_;
};

}  // namespace cohort
