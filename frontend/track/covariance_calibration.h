#pragma once

#include <Eigen/Core>
#include <span>

#include "frontend/track/measurement.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// The inverse gradient energy gives a measurement's covariance its shape; its size depends on how
// the noise is correlated, which the blur of the lens or of the codec decides. So it is taken from
// the cohort: the distance of a measured position from its prediction has the prediction's variance
// and the picture's half of the measurement's own (the other half is the anchor's).
class CovarianceCalibration {
 public:
  struct Sample {
    Eigen::Vector2d difference;            // measured - predicted [px]
    Eigen::Matrix2d predicted_covariance;  // [px^2]
    Eigen::Matrix2d shape;                 // Measurement::shape
  };

  // covariance = scale * shape
  double scale() const { return scale_; }
  Eigen::Matrix2d Covariance(const Eigen::Matrix2d& shape) const { return scale_ * shape; }
  // The picture's half: what measurements of one track do not share.
  Eigen::Matrix2d OfPicture(const Eigen::Matrix2d& shape) const { return 0.5 * scale_ * shape; }

  // A measurement as the trajectory model takes it: with the picture's half of its variance.
  TrajectoryModel::Observation ForModel(const Measurement& m) const;

  // A frame's confirmed measurements; few say nothing.
  void Update(std::span<const Sample> samples);

 private:
  double scale_ = 10.0;  // until the cohort tells; of a blur as typical lenses have
  int updates_ = 0;
};

}  // namespace cohort
