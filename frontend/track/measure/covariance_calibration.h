#pragma once

#include <Eigen/Core>
#include <span>

#include "frontend/track/measure/measurement.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// The inverse gradient energy gives the shape of a measurement's covariance. Its scale depends on
// how the noise is correlated, which the blur of the lens or the codec determines. The scale is
// therefore estimated from all features: a measured position differs from its prediction with the
// prediction's covariance plus half of the measurement's own (the picture's; the other half is the
// anchor's).
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
  // The picture's half, which measurements of one track do not share.
  Eigen::Matrix2d OfPicture(const Eigen::Matrix2d& shape) const { return 0.5 * scale_ * shape; }

  // A measurement as the trajectory model takes it: with the picture's half of its covariance.
  TrajectoryModel::Observation ForModel(const Measurement& m) const;

  // Updates the scale from a frame's confirmed measurements; fewer than eight are ignored.
  void Update(std::span<const Sample> samples);

 private:
  double scale_ = 10.0;  // initial value: that of a typical lens blur
  int updates_ = 0;
};

}  // namespace cohort
