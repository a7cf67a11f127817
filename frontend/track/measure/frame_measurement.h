#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "frontend/image/pyramid.h"
#include "frontend/track/measure/confirmation.h"
#include "frontend/track/measure/covariance_calibration.h"
#include "frontend/track/measure/feature.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// Measures all features in one frame and tests the measurements (steps 2 and 3 of
// docs/how_it_works.md, "One frame").
class FrameMeasurement {
 public:
  // Aligns the large patch of every feature that the last frame confirmed, from its start (2 x F,
  // the guide's), and tests the result. The other features are measured later, from their
  // predictions. `smooth` is the picture denoised for measuring. All arguments but the starts must
  // outlive this.
  FrameMeasurement(const Pyramid& smooth,
                   std::span<const MeasuredFeature> features,
                   const PatchOptions& patch,
                   const CovarianceCalibration& calibration,
                   const Eigen::Matrix2Xd& starts);

  bool IsObserved(std::size_t f) const { return verdicts_[f] == Verdict::kObserved; }
  Verdict verdict(std::size_t f) const { return verdicts_[f]; }
  const Measurement& measurement(std::size_t f) const { return measured_[f]; }
  const Confirmation& confirmation() const { return confirmation_; }

  // The observed features as the trajectory model takes them, with the calibration at the time of
  // measurement.
  const std::vector<TrajectoryModel::Observation>& observed() const { return observed_; }
  std::vector<CovarianceCalibration::Sample> Residuals(
      std::span<const TrajectoryModel::Estimate> predicted) const;

  // Tests whether observed features lie where the others predict them (strong constraint).
  void TestPositions(std::span<const TrajectoryModel::Estimate> predicted);

  // Measures again what is not observed: the large patch from the prediction, then a small one with
  // the prediction as prior, because the rim of the large one may lie on another surface or behind
  // an occluder.
  void MeasureAtPredictions(std::span<const TrajectoryModel::Estimate> predicted, bool strong);
  void MeasureAtPrediction(std::size_t f, const TrajectoryModel::Estimate& predicted, bool strong);

 private:
  void Judge(std::size_t f, Verdict verdict);
  Measurement MeasureFrom(std::size_t f, const Eigen::Vector2d& start) const;
  std::vector<Measurement> MeasureFrom(const Eigen::Matrix2Xd& starts) const;

  const Pyramid& smooth_;
  std::span<const MeasuredFeature> features_;
  const CovarianceCalibration& calibration_;
  std::vector<Measurement> measured_;
  Confirmation confirmation_;
  std::vector<Verdict> verdicts_;
  std::vector<TrajectoryModel::Observation> observed_;
};

}  // namespace cohort
