#include "frontend/track/measure/frame_measurement.h"

#include <algorithm>
#include <cmath>

#include "frontend/core/in_parallel.h"
#include "frontend/core/part_times.h"

namespace cohort {
namespace {

// The prior of a small patch is wide, so that it guides and does not decide: this many deviations
// of the prediction, and no less than a share of a pixel. Tuned on the tuning clips.
constexpr int kSmallWindowPx = 11;
constexpr double kPriorFactor = 3.0;
constexpr double kLeastPriorPx = 0.3;

}  // namespace

FrameMeasurement::FrameMeasurement(const Pyramid& smooth,
                                   std::span<const MeasuredFeature> features,
                                   const PatchOptions& patch,
                                   const CovarianceCalibration& calibration,
                                   const Eigen::Matrix2Xd& starts)
    : smooth_(smooth),
      features_(features),
      calibration_(calibration),
      measured_(MeasureFrom(starts)),
      confirmation_(smooth, patch, calibration, features, measured_),
      verdicts_(features.size(), Verdict::kNotMeasured),
      observed_(features.size()) {
  const TimedPart part("measurement");
  for (std::size_t f = 0; f < features.size(); ++f) {
    if (!features[f].confirmed) continue;
    Judge(f,
          confirmation_.TestPatch(
              features[f], measured_[f], starts.col(static_cast<Eigen::Index>(f))));
  }
}

std::vector<Measurement> FrameMeasurement::MeasureFrom(const Eigen::Matrix2Xd& starts) const {
  const TimedPart part("measurement");
  std::vector<Measurement> measured(features_.size());
  ForEachInParallel(features_.size(), [&](std::size_t f) {
    if (!features_[f].confirmed) return;
    measured[f] = MeasureFrom(f, starts.col(static_cast<Eigen::Index>(f)));
  });
  return measured;
}

Measurement FrameMeasurement::MeasureFrom(std::size_t f, const Eigen::Vector2d& start) const {
  const MeasuredFeature& feature = features_[f];
  return MeasurePatch(smooth_, feature.anchor, start, feature.window_px, calibration_.scale());
}

void FrameMeasurement::Judge(std::size_t f, Verdict verdict) {
  verdicts_[f] = verdict;
  observed_[f] = {};
  if (verdict == Verdict::kObserved) observed_[f] = calibration_.ForModel(measured_[f]);
}

std::vector<CovarianceCalibration::Sample> FrameMeasurement::Residuals(
    std::span<const TrajectoryModel::Estimate> predicted) const {
  std::vector<CovarianceCalibration::Sample> samples;
  for (std::size_t f = 0; f < features_.size(); ++f) {
    if (!IsObserved(f)) continue;
    samples.push_back({measured_[f].xy - predicted[f].expected_xy,
                       predicted[f].measured_covariance,
                       measured_[f].shape});
  }
  return samples;
}

void FrameMeasurement::TestPositions(std::span<const TrajectoryModel::Estimate> predicted) {
  const TimedPart part("measurement");
  ForEachInParallel(features_.size(), [&](std::size_t f) {
    if (!IsObserved(f)) return;
    Judge(f, confirmation_.TestPosition(features_[f], measured_[f], predicted[f]));
  });
}

void FrameMeasurement::MeasureAtPredictions(std::span<const TrajectoryModel::Estimate> predicted,
                                            bool strong) {
  const TimedPart part("measurement");
  ForEachInParallel(predicted.size(), [&](std::size_t f) {
    if (!IsObserved(f)) MeasureAtPrediction(f, predicted[f], strong);
  });
}

void FrameMeasurement::MeasureAtPrediction(std::size_t f,
                                           const TrajectoryModel::Estimate& predicted,
                                           bool strong) {
  const MeasuredFeature& feature = features_[f];
  const Eigen::Vector2d& start = predicted.expected_xy;
  measured_[f] = MeasureFrom(f, start);
  Judge(f, confirmation_.TestPatchAtPrediction(feature, measured_[f], predicted, strong));
  if (IsObserved(f)) return;
  const double sigma_px = std::sqrt(0.5 * predicted.measured_covariance.trace());
  const double prior_px = std::max(kPriorFactor * sigma_px, kLeastPriorPx);
  measured_[f] = MeasurePatch(smooth_,
                              feature.anchor,
                              start,
                              kSmallWindowPx,
                              calibration_.scale(),
                              confirmation_.noise_variance(),
                              Eigen::Matrix2d::Identity() / (prior_px * prior_px));
  Judge(f, confirmation_.TestSmallPatchAtPrediction(feature, measured_[f], predicted, strong));
}

}  // namespace cohort
