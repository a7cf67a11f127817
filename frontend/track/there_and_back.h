#pragma once

#include <Eigen/Core>
#include <span>

#include "frontend/image/pyramid.h"
#include "frontend/track/feature.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// Lucas-Kanade from the last picture and back, as a plain tracker would: beside the joint guide, a
// second opinion of where a feature went, which reaches further (BetterStarts). It costs more than
// the guide, and is asked where the guide's position shows something else, or might.
//
// Where the camera moves fast, the other features cannot say where a new one is, and alignment may
// end at any similar pattern nearby. So what they leave open by more than `max_open_px` must be
// where Lucas-Kanade finds it and finds back from. 0: nothing is open. Starts compete in any case.
class ThereAndBack {
 public:
  explicit ThereAndBack(double max_open_px) : max_open_px_(max_open_px) {}

  // The last picture of the next call.
  void Remember(const Pyramid& picture) { previous_ = picture; }
  // Sets returned_xy of the features `which`. `newest`: 2 x F, where all were in the last picture.
  void Track(const Pyramid& current,
             const Eigen::Matrix2Xd& newest,
             std::span<const std::size_t> which,
             std::span<Feature> features);

  // The guide, but where Lucas-Kanade is elsewhere and the picture looks more like the template
  // there: a camera too fast for the guide. `n`: side of the templates.
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
