#pragma once

#include <Eigen/Core>
#include <span>

#include "frontend/image/pyramid.h"
#include "frontend/track/measure/feature.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// Lucas-Kanade from the last picture with a forward-backward check, as a plain tracker does. It
// gives a second position beside the joint guide's and reaches further (BetterStarts). It costs
// more than the guide and runs only where the guide's position shows something else, or might.
//
// Where the camera moves fast, the other features cannot predict a new one, and alignment may end
// at any similar pattern nearby. If the prediction's deviation exceeds `max_open_px`, the feature
// must therefore be where this check confirms it. 0 disables that test. Starts compete in any case.
class ThereAndBack {
 public:
  explicit ThereAndBack(double max_open_px) : max_open_px_(max_open_px) {}

  // Stores the picture as the last one of the next call.
  void Remember(const Pyramid& picture) { previous_ = picture; }
  // Sets returned_xy of the features `which`. `newest`: 2 x F, all positions in the last picture.
  void Track(const Pyramid& current,
             const Eigen::Matrix2Xd& newest,
             std::span<const std::size_t> which,
             std::span<Feature> features);

  // The guide's positions, or Lucas-Kanade's where that differs and looks more like the template (a
  // camera too fast for the guide). `n`: side of the templates.
  static Eigen::Matrix2Xd BetterStarts(const Pyramid& current,
                                       const Eigen::Matrix2Xd& guide,
                                       std::span<const Feature> features,
                                       int n);

  bool IsOpen(const TrajectoryModel::Estimate& predicted) const;

 private:
  double max_open_px_;
  Pyramid previous_;
};

}  // namespace cohort
