#include "frontend/track/measure/covariance_calibration.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "frontend/core/statistics.h"

namespace cohort {

TrajectoryModel::Observation CovarianceCalibration::ForModel(const Measurement& m) const {
  return {m.xy, OfPicture(m.shape).inverse(), false};
}

void CovarianceCalibration::Update(std::span<const Sample> samples) {
  constexpr std::size_t kLeastSamples = 8;
  // The first frames find the size and the later ones follow it. Tuned on the tuning clips.
  constexpr int kQuickUpdates = 5;
  constexpr double kQuickRate = 0.7;
  constexpr double kRate = 0.1;
  if (samples.size() < kLeastSamples) return;
  std::vector<double> squares;
  for (const Sample& sample : samples) {
    const Eigen::Matrix2d S = sample.predicted_covariance + OfPicture(sample.shape);
    squares.push_back(sample.difference.dot(S.inverse() * sample.difference));
  }
  const double ratio = Median(std::move(squares)) / kMedianChiSquare2;
  const double rate = ++updates_ <= kQuickUpdates ? kQuickRate : kRate;
  // Frames that repeat exactly would say that there is no noise, and bring it to nothing. Real and
  // rendered clips that move came to 0.44 and more.
  constexpr double kLeastScale = 0.05;
  scale_ = std::max(kLeastScale, scale_ * std::pow(ratio, rate));
}

}  // namespace cohort
