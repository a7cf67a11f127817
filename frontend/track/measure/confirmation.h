#pragma once

#include <Eigen/Core>
#include <span>
#include <string_view>

#include "frontend/image/pyramid.h"
#include "frontend/track/measure/covariance_calibration.h"
#include "frontend/track/measure/feature.h"
#include "frontend/track/measure/measurement.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// The result of the tests of one measurement: the first test that it fails, or kObserved.
enum class Verdict {
  kObserved,
  kNotMeasured,       // not tried, or the alignment did not converge
  kTooFarFromStart,   // ended more than max_distance_px from its start
  kUnlikeTheAnchor,   // correlates too little, or differs by more than noise explains
  kCenterDiffers,     // the innermost pixels show something else, which hides the feature
  kTooUncertain,      // the patch has too little texture to locate it
  kNotWhereExpected,  // disagrees with the other features beyond both uncertainties
  kPushed,            // an occluder pushed the patch: the expected position shows something else
};

// The tests of one frame's measurements. `strong` enables the tests against the other features.
class Confirmation {
 public:
  // `picture` is denoised for measuring. The noise level is estimated from the features themselves:
  // the median over `measured`, without those that did not converge. All arguments must outlive
  // this.
  Confirmation(const Pyramid& picture,
               const PatchOptions& patch,
               const CovarianceCalibration& calibration,
               std::span<const MeasuredFeature> features,
               std::span<const Measurement> measured);

  // Variance of picture minus anchor, intensities 0..1.
  double noise_variance() const { return noise_variance_; }

  // Tests whether a patch whose alignment began at `start` is near it and looks like the anchor.
  Verdict TestPatch(const MeasuredFeature& feature,
                    const Measurement& m,
                    const Eigen::Vector2d& start) const;
  // Tests whether it is where the other features predict it.
  Verdict TestPosition(const MeasuredFeature& feature,
                       const Measurement& m,
                       const TrajectoryModel::Estimate& predicted) const;
  // Both tests for a patch whose alignment began at the prediction. With `strong` the position test
  // replaces the test of the distance from the start.
  Verdict TestPatchAtPrediction(const MeasuredFeature& feature,
                                const Measurement& m,
                                const TrajectoryModel::Estimate& predicted,
                                bool strong) const;
  // The same for a small patch, which consists mostly of the innermost pixels.
  Verdict TestSmallPatchAtPrediction(const MeasuredFeature& feature,
                                     const Measurement& m,
                                     const TrajectoryModel::Estimate& predicted,
                                     bool strong) const;

  // Whether the innermost pixels at the prediction, within its uncertainty, show something else.
  bool IsHidden(const MeasuredFeature& feature, const TrajectoryModel::Estimate& predicted) const;

  // Updates the feature's appearance from a confirmed measurement.
  void Learn(const Measurement& m, MeasuredFeature& feature) const;

 private:
  Verdict TestAppearance(const MeasuredFeature& feature, const Measurement& m) const;
  Verdict TestAgreement(const MeasuredFeature& feature,
                        const Measurement& m,
                        const TrajectoryModel::Estimate& predicted) const;
  // The mean square difference of the innermost pixels, as a multiple of what is expected when the
  // position has a standard deviation of sigma_px.
  double CenterRatio(const MeasuredFeature& feature,
                     const Eigen::Vector2d& xy,
                     double sigma_px) const;
  double CenterRatio(const MeasuredFeature& feature,
                     const CenterDifference& center,
                     double sigma_px) const;

  const Pyramid& picture_;
  const PatchOptions& patch_;
  const CovarianceCalibration& calibration_;
  double noise_variance_ = 0.0;
  double center_noise_ = 0.0;
};

}  // namespace cohort
