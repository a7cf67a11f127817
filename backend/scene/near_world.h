#pragma once

#include <map>
#include <optional>

#include "backend/scene/reconstruction.h"
#include "frontend/geometry/rigid3.h"
#include "frontend/geometry/sim3.h"

namespace cohort {

// Coordinates of a georeferenced model are millions of metres: squares of them, as triangulation
// and adjustment take, have no digits left for what lies between the cameras. And bounds on depths
// are made for worlds of about unit scale.
//
// The similarity that moves such cameras so that their mean centre is the origin and their root mean
// square distance from it 1. None where they are near enough as they are: nothing changes then.
std::optional<Sim3> NearFromWorld(const std::map<FrameIndex, Rigid3>& cam_from_world);

// Cameras and points in another world.
Reconstruction MoveWorld(const Sim3& target_from_world, Reconstruction reconstruction);

// A model in the world that NearFromWorld leads to, and the way back. `model` must outlive it: where
// it is near enough it is not copied.
class NearModel {
 public:
  explicit NearModel(const Reconstruction& model);

  const Reconstruction& get() const { return moved_ ? *moved_ : model_; }
  // What was made of it, in the world of `model`.
  Reconstruction InWorldOfModel(Reconstruction made) const;
  bool IsMoved() const { return moved_.has_value(); }

 private:
  const Reconstruction& model_;
  std::optional<Sim3> near_from_world_;
  std::optional<Reconstruction> moved_;
};

}  // namespace cohort
