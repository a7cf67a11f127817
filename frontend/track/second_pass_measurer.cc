#include "frontend/track/second_pass_measurer.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <set>

#include "frontend/core/statistics.h"
#include "frontend/image/pyramid.h"

namespace cohort {
namespace {

// How much less a blurred window's pixels say than as many independent ones: rough, as only the
// prior of the warp depends on it.
constexpr double kNoiseFactor = 10.0;

constexpr double kWarpNoisePerFrame = PatchOptions{}.warp_noise;  // as the tracker's

// A feature is taken for itself where it correlates with its template at least by this share of
// what it has where the first pass saw it; chosen by eye on the tuning clips with an occluder.
constexpr double kLeastRelativeCorrelation = 0.7;

Pyramid SmoothPyramidOf(const Frame& frame, double sigma_px) {
  constexpr int kLevels = 2;
  return SmoothPyramid(BuildPyramid(frame.gray, kLevels), sigma_px);
}

AnchorPatch Mean(const AnchorPatch& sum, int frames, int window_px) {
  AnchorPatch mean;
  mean.full = sum.full / frames;
  if (!sum.half.empty()) mean.half = sum.half / frames;
  const int margin = (mean.full.cols - window_px) / 2;
  cv::Scalar average;
  cv::Scalar deviation;
  cv::meanStdDev(mean.full({margin, margin, window_px, window_px}), average, deviation);
  mean.signal_variance = deviation[0] * deviation[0];
  return mean;
}

// A mean of few values is drawn to `expected`, which counts as so many.
double DrawnMean(double sum, double count, double expected) {
  constexpr double kPrior = 6.0;
  return (sum + kPrior * expected) / (count + kPrior);
}

}  // namespace

SecondPassMeasurer::SecondPassMeasurer(const SecondPassMeasurementOptions& options)
    : options_(options) {
  ValidateOptions(options);
  for (const int px : std::set{options.patch.window_px, options.patch.wide_window_px}) {
    windows_.emplace_back().px = px;
  }
}

void SecondPassMeasurer::Learn(const Frame& frame, std::span<const ModelPrediction> predictions) {
  if (predictions.empty()) return;
  const Pyramid pyramid = SmoothPyramidOf(frame, options_.patch.denoise_sigma_px);
  const int largest_px = windows_.back().px;
  for (const ModelPrediction& prediction : predictions) {
    const AnchorPatch patch =
        TakeAnchor(pyramid, prediction.xy, largest_px, largest_px, prediction.warp);
    Template& t = templates_[prediction.feature];
    if (t.frames == 0) {
      t.sum = patch;
    } else {
      t.sum.full += patch.full;
      if (!t.sum.half.empty()) t.sum.half += patch.half;
    }
    ++t.frames;
  }
}

void SecondPassMeasurer::Measure(const Frame& frame, std::span<const ModelPrediction> predictions) {
  const Pyramid pyramid = SmoothPyramidOf(frame, options_.patch.denoise_sigma_px);
  for (Window& window : windows_) MeasureWith(window, frame, predictions, pyramid);
}

void SecondPassMeasurer::MeasureWith(Window& window,
                                     const Frame& frame,
                                     std::span<const ModelPrediction> predictions,
                                     const Pyramid& pyramid) const {
  std::vector<std::pair<const ModelPrediction*, Measurement>> measured;
  std::vector<double> signal_variances;
  std::vector<double> variances;
  for (const ModelPrediction& prediction : predictions) {
    const auto it = templates_.find(prediction.feature);
    if (it == templates_.end()) continue;
    AnchorPatch anchor = Mean(it->second.sum, it->second.frames, window.px);
    const auto [known, first] = window.deformations.try_emplace(prediction.feature);
    Deformation& deformation = known->second;
    const double noise = first ? options_.patch.warp_noise : kWarpNoisePerFrame;
    deformation.covariance.diagonal().array() += noise * noise;
    anchor.warp = deformation.beyond_prediction * prediction.warp;
    anchor.warp_covariance = deformation.covariance;
    const Measurement m = MeasurePatch(pyramid, anchor, prediction.xy, window.px, kNoiseFactor);
    if (!m.converged) continue;
    if ((m.xy - prediction.xy).norm() <= options_.patch.max_distance_px &&
        m.correlation >= options_.patch.min_correlation) {
      deformation.beyond_prediction = m.warp * prediction.warp.inverse();
      deformation.covariance = m.warp_covariance;
    }
    measured.emplace_back(&prediction, m);
    signal_variances.push_back(anchor.signal_variance);
    if (prediction.observed_in_first_pass) variances.push_back(m.residual_variance);
  }
  constexpr std::size_t kEnough = 8;  // for a median; with fewer, that of the frame before stays
  if (variances.size() >= kEnough || window.noise_variance == 0.0) {
    window.noise_variance = Median(std::move(variances));
  }
  for (std::size_t i = 0; i < measured.size(); ++i) {
    const auto& [prediction, m] = measured[i];
    const Eigen::Vector2d d = m.xy - prediction->xy;
    Sighting s;
    s.frame = frame.index;
    s.observed_before = prediction->observed_in_first_pass;
    s.distance_px = d.norm();
    s.mahalanobis2 = d.dot(m.shape.inverse() * d);
    s.correlation = m.correlation;
    // Noise, and what the small errors of warp and interpolation leave of the pattern.
    s.residual_variance_ratio =
        m.residual_variance /
        std::max(window.noise_variance + kPatternShare * signal_variances[i], 1e-12);
    s.residual = m.residual;
    s.xy = m.xy;
    s.shape = m.shape;
    window.sightings[prediction->feature].push_back(s);
  }
}

std::map<FeatureId, double> SecondPassMeasurer::MeanSquareDistances(const Window& window) const {
  struct Sum {
    double squares = 0.0;
    double count = 0.0;
  };
  Sum all;
  std::map<FeatureId, Sum> sums;
  for (const auto& [feature, sightings] : window.sightings) {
    Sum& sum = sums[feature];
    for (const Sighting& s : sightings) {
      if (!s.observed_before) continue;
      const double distance_px = std::min(s.distance_px, options_.patch.max_distance_px);
      sum.squares += distance_px * distance_px;
      sum.count += 1.0;
    }
    all.squares += sum.squares;
    all.count += sum.count;
  }
  std::map<FeatureId, double> means;
  for (const auto& [feature, sum] : sums) {
    means[feature] = DrawnMean(sum.squares, sum.count, all.squares / std::max(all.count, 1.0));
  }
  return means;
}

std::map<FeatureId, const SecondPassMeasurer::Window*> SecondPassMeasurer::ChooseWindows() const {
  std::map<FeatureId, const Window*> chosen;
  std::map<FeatureId, double> least;
  for (const Window& window : windows_) {
    for (const auto& [feature, mean_square] : MeanSquareDistances(window)) {
      const auto [it, first] = least.try_emplace(feature, mean_square);
      if (!first && mean_square >= it->second) continue;
      it->second = mean_square;
      chosen[feature] = &window;
    }
  }
  return chosen;
}

std::vector<Observation> SecondPassMeasurer::Finish() const {
  const std::map<FeatureId, const Window*> chosen = ChooseWindows();
  std::vector<double> squares;
  for (const auto& [feature, window] : chosen) {
    for (const Sighting& s : window->sightings.at(feature)) {
      if (s.observed_before && s.distance_px <= options_.patch.max_distance_px) {
        squares.push_back(s.mahalanobis2);
      }
    }
  }
  const double scale = std::max(Median(std::move(squares)) / (2.0 * std::log(2.0)), 1e-6);

  std::vector<Observation> observations;
  for (const auto& [feature, window] : chosen) {
    const std::vector<Sighting>& sightings = window->sightings.at(feature);
    std::vector<double> correlations;
    for (const Sighting& s : sightings) {
      if (s.observed_before) correlations.push_back(s.correlation);
    }
    const double least = std::max(options_.patch.min_correlation,
                                  kLeastRelativeCorrelation * Median(std::move(correlations)));
    for (const Sighting& s : sightings) {
      if (s.distance_px > options_.patch.max_distance_px || s.correlation < least ||
          s.residual_variance_ratio > options_.patch.max_residual_ratio) {
        continue;
      }
      Observation& o = observations.emplace_back();
      o.feature = feature;
      o.frame = s.frame;
      o.xy = s.xy;
      o.residual = s.residual;
      o.covariance = PixelCovariance::From(scale * s.shape);
    }
  }
  return observations;
}

}  // namespace cohort
