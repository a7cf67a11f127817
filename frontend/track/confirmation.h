#pragma once

#include <Eigen/Core>
#include <span>
#include <string_view>

#include "frontend/image/pyramid.h"
#include "frontend/track/covariance_calibration.h"
#include "frontend/track/feature.h"
#include "frontend/track/measurement.h"
#include "frontend/track/there_and_back.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// What the tests say of a measurement: the first one that it fails, or that the image confirms it.
enum class Verdict {
  kObserved,
  kNotMeasured,       // not tried, or the alignment did not converge
  kTooFarFromStart,   // ended further from where it began than max_distance_px
  kUnlikeTheAnchor,   // correlates too little, or differs by more than noise explains
  kCenterDiffers,     // the innermost pixels show something else, which hides the feature
  kTooUncertain,      // the patch has too little texture to say where it is
  kNotWhereExpected,  // lies elsewhere than the other features say, beyond what both leave open
  kDidNotReturn,      // the others cannot say where it is, and Lucas-Kanade does not find it there
  kPushed,            // an occluder pushed the patch: where it should be, something else is seen
};

// The tests of one frame's measurements. `strong` tests are those against the other features.
class Confirmation {
 public:
  // `picture` is denoised for measuring. How much noise there is, is the cohort's own: the median
  // over `measured`, of all features; those that did not converge do not count. All arguments must
  // outlive this.
  Confirmation(const Pyramid& picture,
               const PatchOptions& patch,
               const ThereAndBack& there_and_back,
               const CovarianceCalibration& calibration,
               std::span<const Feature> features,
               std::span<const Measurement> measured);

  // Of a picture minus an anchor, intensities 0..1.
  double noise_variance() const { return noise_variance_; }

  // A patch whose alignment began at `start`: near it, and the anchor?
  Verdict TestPatch(const Feature& feature,
                    const Measurement& m,
                    const Eigen::Vector2d& start) const;
  // Is it where the other features say?
  Verdict TestPosition(const Feature& feature,
                       const Measurement& m,
                       const TrajectoryModel::Estimate& predicted) const;
  // The same two of a patch that began at the prediction: with `strong` the position's test takes
  // the place of the distance from the start.
  Verdict TestPatchAtPrediction(const Feature& feature,
                                const Measurement& m,
                                const TrajectoryModel::Estimate& predicted,
                                bool strong) const;
  // A small patch there, which is mostly the innermost pixels.
  Verdict TestSmallPatchAtPrediction(const Feature& feature,
                                     const Measurement& m,
                                     const TrajectoryModel::Estimate& predicted,
                                     bool strong) const;

  // Do the innermost pixels at the prediction, within what it leaves open, show something else?
  bool IsHidden(const Feature& feature, const TrajectoryModel::Estimate& predicted) const;

  // What a confirmed measurement teaches of the feature's appearance.
  void Learn(const Measurement& m, Feature& feature) const;

 private:
  Verdict TestAppearance(const Feature& feature, const Measurement& m) const;
  Verdict TestAgreement(const Feature& feature,
                        const Measurement& m,
                        const TrajectoryModel::Estimate& predicted) const;
  // The mean square difference of the innermost pixels, as a multiple of what is expected with the
  // feature at a position that is known to sigma_px.
  double CenterRatio(const Feature& feature, const Eigen::Vector2d& xy, double sigma_px) const;
  double CenterRatio(const Feature& feature, const CenterDifference& center, double sigma_px) const;

  const Pyramid& picture_;
  const PatchOptions& patch_;
  const ThereAndBack& there_and_back_;
  const CovarianceCalibration& calibration_;
  double noise_variance_ = 0.0;
  double center_noise_ = 0.0;
};

}  // namespace cohort
