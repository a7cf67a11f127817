#pragma once

#include <Eigen/Core>

namespace cohort::trajectory_model {

// Where a feature was measured in a frame, as y = xy + noise with noise ~ N(0, information^-1).
struct Observation {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();           // [px]
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();  // [1/px^2]; zero: not observed
  bool anchor = false;                                    // the anchor was taken here

  bool IsObserved() const { return information(0, 0) > 0.0; }
};

}  // namespace cohort::trajectory_model
