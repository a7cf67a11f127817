#include "frontend/track/measure/confirmation.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

// All are tuned on the tuning clips.
//
// The innermost pixels differ from the anchor's by more than so many times what is expected: what
// is seen there is something else.
constexpr double kMaxCenterRatio = 4.0;
constexpr double kLeastCorrelation = 0.1;  // whatever the noise is, and of a small patch
// The deviation of a measurement that tells enough [px]; half of it for what comes back.
constexpr double kMaxSigmaPx = 4.0;
// From where the other features say that it is [px]; what measurement and prediction leave open is
// allowed in addition, so many deviations of it.
constexpr double kMaxDisagreementPx = 3.0;
constexpr double kMaxDisagreementSigmas = 5.0;
// The deviation of a position [px] below which a feature is measured well, by a narrow patch.
constexpr double kMeasuredWellPx = 0.5;

double CenterSquare(const MeasuredFeature& feature, const CenterDifference& center) {
  const double darker = center.mean - feature.light;
  return center.variance + darker * darker;
}

}  // namespace

Confirmation::Confirmation(const Pyramid& picture,
                           const PatchOptions& patch,
                           const CovarianceCalibration& calibration,
                           std::span<const MeasuredFeature> features,
                           std::span<const Measurement> measured)
    : picture_(picture), patch_(patch), calibration_(calibration) {
  std::vector<double> variances;
  std::vector<double> centers;
  for (std::size_t f = 0; f < measured.size(); ++f) {
    if (!measured[f].converged) continue;
    variances.push_back(measured[f].residual_variance);
    centers.push_back(CenterSquare(features[f], measured[f].center));
  }
  noise_variance_ = Median(std::move(variances));
  center_noise_ = Median(std::move(centers));
}

double Confirmation::CenterRatio(const MeasuredFeature& feature,
                                 const CenterDifference& center,
                                 double sigma_px) const {
  const AnchorPatch& anchor = feature.anchor;
  return CenterSquare(feature, center) / (center_noise_ + kPatternShare * anchor.signal_variance +
                                          anchor.mean_square_gradient * sigma_px * sigma_px);
}

double Confirmation::CenterRatio(const MeasuredFeature& feature,
                                 const Eigen::Vector2d& xy,
                                 double sigma_px) const {
  return CenterRatio(feature, CompareCenter(picture_, feature.anchor, xy), sigma_px);
}

Verdict Confirmation::TestPatch(const MeasuredFeature& feature,
                                const Measurement& m,
                                const Eigen::Vector2d& start) const {
  if (!((m.xy - start).norm() <= patch_.max_distance_px)) return Verdict::kTooFarFromStart;
  return TestAppearance(feature, m);
}

Verdict Confirmation::TestAppearance(const MeasuredFeature& feature, const Measurement& m) const {
  if (!m.converged) return Verdict::kNotMeasured;
  const double variance = feature.anchor.signal_variance;
  const double expected = noise_variance_ + kPatternShare * variance;
  // Half of the noise is the anchor's.
  const double possible =
      ExpectedCorrelation(variance, 0.5 * noise_variance_, 0.5 * noise_variance_);
  if (!(m.correlation >= std::max(kLeastCorrelation, patch_.min_correlation * possible) &&
        m.residual_variance <= patch_.max_residual_ratio * expected)) {
    return Verdict::kUnlikeTheAnchor;
  }
  if (!(CenterRatio(feature, m.center, 0.0) <= kMaxCenterRatio)) return Verdict::kCenterDiffers;
  return Verdict::kObserved;
}

Verdict Confirmation::TestPosition(const MeasuredFeature& feature,
                                   const Measurement& m,
                                   const TrajectoryModel::Estimate& predicted) const {
  const Verdict agreement = TestAgreement(feature, m, predicted);
  if (agreement != Verdict::kObserved) return agreement;
  // An occluder pushes a patch before it, to where the feature's surroundings still look like it.
  // Then its prediction shows more than a displacement by so much explains.
  const Eigen::Vector2d& expected = predicted.expected_xy;
  return CenterRatio(feature, expected, (m.xy - expected).norm()) > kMaxCenterRatio
             ? Verdict::kPushed
             : Verdict::kObserved;
}

// The distance from the prediction against what both leave open. What was not seen in the last
// frame must show more to be believed.
Verdict Confirmation::TestAgreement(const MeasuredFeature& feature,
                                    const Measurement& m,
                                    const TrajectoryModel::Estimate& predicted) const {
  const double max_sigma_px = feature.confirmed ? kMaxSigmaPx : 0.5 * kMaxSigmaPx;
  const Eigen::Matrix2d noise = calibration_.OfPicture(m.shape);
  if (noise.trace() > max_sigma_px * max_sigma_px) return Verdict::kTooUncertain;
  constexpr double kLeastSigmaPx = kMaxDisagreementPx / kMaxDisagreementSigmas;
  const Eigen::Matrix2d S = predicted.measured_covariance + noise +
                            kLeastSigmaPx * kLeastSigmaPx * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d d = m.xy - predicted.expected_xy;
  if (!(d.dot(S.inverse() * d) <= kMaxDisagreementSigmas * kMaxDisagreementSigmas)) {
    return Verdict::kNotWhereExpected;
  }
  return Verdict::kObserved;
}

Verdict Confirmation::TestPatchAtPrediction(const MeasuredFeature& feature,
                                            const Measurement& m,
                                            const TrajectoryModel::Estimate& predicted,
                                            bool strong) const {
  if (!strong) return TestPatch(feature, m, predicted.expected_xy);
  const Verdict appearance = TestAppearance(feature, m);
  return appearance == Verdict::kObserved ? TestPosition(feature, m, predicted) : appearance;
}

Verdict Confirmation::TestSmallPatchAtPrediction(const MeasuredFeature& feature,
                                                 const Measurement& m,
                                                 const TrajectoryModel::Estimate& predicted,
                                                 bool strong) const {
  if (!m.converged) return Verdict::kNotMeasured;
  if (strong) {
    const Verdict agreement = TestAgreement(feature, m, predicted);
    if (agreement != Verdict::kObserved) return agreement;
  } else if (!((m.xy - predicted.expected_xy).norm() <= patch_.max_distance_px)) {
    return Verdict::kTooFarFromStart;
  }
  if (!(m.correlation >= kLeastCorrelation)) return Verdict::kUnlikeTheAnchor;
  if (!(CenterRatio(feature, m.center, 0.0) <= kMaxCenterRatio)) return Verdict::kCenterDiffers;
  return Verdict::kObserved;
}

bool Confirmation::IsHidden(const MeasuredFeature& feature,
                            const TrajectoryModel::Estimate& predicted) const {
  const double sigma_px = std::sqrt(0.5 * predicted.measured_covariance.trace());
  return CenterRatio(feature, predicted.expected_xy, sigma_px) > kMaxCenterRatio;
}

void Confirmation::Learn(const Measurement& m, MeasuredFeature& feature) const {
  constexpr double kChangeRate = 0.1;
  constexpr double kLightRate = 0.3;
  constexpr double kGradientsMemory = 20.0;
  AnchorPatch& anchor = feature.anchor;
  anchor.warp = m.warp;
  anchor.warp_covariance = m.warp_covariance;
  anchor.gradients = m.gradients;
  anchor.gradients_count = std::min(anchor.gradients_count + 1.0, kGradientsMemory);
  if (m.window_px == patch_.wide_window_px && m.window_px > patch_.window_px &&
      0.5 * calibration_.Covariance(m.shape).trace() < kMeasuredWellPx * kMeasuredWellPx) {
    feature.window_px = patch_.window_px;
    NarrowAnchor(feature.window_px, anchor);
    anchor.gradients_count = 0.0;
  }
  feature.change += kChangeRate * (CenterRatio(feature, m.center, 0.0) - feature.change);
  feature.light += kLightRate * (m.center.mean - feature.light);
}

}  // namespace cohort
