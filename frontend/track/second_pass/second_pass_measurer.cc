#include "frontend/track/second_pass/second_pass_measurer.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/core.hpp>
#include <set>

#include "frontend/core/in_parallel.h"
#include "frontend/core/part_times.h"
#include "frontend/core/statistics.h"
#include "frontend/image/pyramid.h"

namespace cohort {
namespace {

constexpr double kWarpNoisePerFrame = PatchOptions{}.warp_noise;  // as the tracker's

// A feature is taken for itself where it correlates with its template at least by this share of
// what it has where the first pass saw it; tuned on the tuning clips with an occluder.
constexpr double kLeastRelativeCorrelation = 0.7;

// Correlations with other places, for a mean.
constexpr double kEnoughChance = 20.0;

// The measurements that are made once more elsewhere: every one at first, and ever fewer the more
// there are.
std::size_t EveryOther(double measured_elsewhere) {
  return 1 + static_cast<std::size_t>(measured_elsewhere / 100.0);
}

Pyramid SmoothPyramidOf(const Frame& frame, double sigma_px) {
  constexpr int kLevels = 2;
  return SmoothPyramid(BuildPyramid(frame, kLevels), sigma_px);
}

// Of the middle of a template.
double SignalVariance(const cv::Mat& patch, int window_px) {
  const int margin = (patch.cols - window_px) / 2;
  cv::Scalar average;
  cv::Scalar deviation;
  cv::meanStdDev(patch({margin, margin, window_px, window_px}), average, deviation);
  return deviation[0] * deviation[0];
}

// A place that does not show the feature at `xy`: so far from it, towards the middle of the picture.
Eigen::Vector2d ElsewhereThan(const Eigen::Vector2d& xy, int distance_px, const Pyramid& pyramid) {
  const Eigen::Vector2d inwards =
      0.5 * Eigen::Vector2d(pyramid.levels[0].cols, pyramid.levels[0].rows) - xy;
  const double length = inwards.norm();
  return xy + distance_px * (length > distance_px ? inwards / length : Eigen::Vector2d(1.0, 0.0));
}

double Mean(const std::vector<double>& values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

// The deviation of one feature's correlations from frame to frame, over all features.
double SpreadOf(const std::map<FeatureId, std::vector<double>>& correlations) {
  double squares = 0.0;
  double degrees = 0.0;
  for (const auto& [feature, of_feature] : correlations) {
    if (of_feature.size() < 2) continue;
    const double mean = Mean(of_feature);
    for (const double c : of_feature) squares += (c - mean) * (c - mean);
    degrees += static_cast<double>(of_feature.size()) - 1.0;
  }
  return degrees > 0.0 ? std::sqrt(squares / degrees) : 0.0;
}

// Whether the mean of a feature's correlations exceeds that of other places by less than chance
// does once in a thousand times.
bool IsChance(const std::vector<double>& correlations, double by_chance, double spread) {
  constexpr double kSigmas = 3.0;
  return correlations.empty() ||
         Mean(correlations) <
             by_chance + kSigmas * spread / std::sqrt(static_cast<double>(correlations.size()));
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

SecondPassMeasurer::PackedPicture SecondPassMeasurer::PackedPicture::Of(const cv::Mat& picture) {
  constexpr double kMostLevel = 65535.0;
  PackedPicture packed;
  double most = 0.0;
  cv::minMaxLoc(picture, &packed.least, &most);
  packed.step = (most - packed.least) / kMostLevel;
  const double per_level = packed.step > 0.0 ? 1.0 / packed.step : 0.0;
  picture.convertTo(packed.levels, CV_16U, per_level, -packed.least * per_level);
  return packed;
}

cv::Mat SecondPassMeasurer::PackedPicture::Unpacked() const {
  cv::Mat picture;
  if (!levels.empty()) levels.convertTo(picture, CV_32F, step, least);
  return picture;
}

void SecondPassMeasurer::Learn(const Frame& frame, std::span<const ModelPrediction> predictions) {
  if (predictions.empty()) return;
  const TimedPart part("templates");
  const Pyramid pyramid = SmoothPyramidOf(frame, options_.patch.denoise_sigma_px);
  const int largest_px = windows_.back().px;
  std::vector<Template*> templates;
  for (const ModelPrediction& prediction : predictions) {
    templates.push_back(&templates_[prediction.feature]);
  }
  ForEachInParallel(predictions.size(), [&](std::size_t i) {
    const ModelPrediction& prediction = predictions[i];
    const AnchorPatch patch = CopyAnchor(pyramid, prediction.xy, largest_px, prediction.warp);
    Template& t = *templates[i];
    if (t.frames.empty()) {
      t.sum = patch;
    } else {
      t.sum.full += patch.full;
      if (!t.sum.half.empty()) t.sum.half += patch.half;
    }
    t.frames.push_back(frame.index);
    if (static_cast<int>(t.frames.size()) == options_.template_frames) Finish(t);
  });
}

void SecondPassMeasurer::Finish(Template& t) const {
  const auto count = static_cast<double>(t.frames.size());
  const cv::Mat full = t.sum.full / count;
  for (const Window& window : windows_) {
    t.signal_variances.push_back(SignalVariance(full, window.px));
  }
  t.full = PackedPicture::Of(full);
  if (!t.sum.half.empty()) t.half = PackedPicture::Of(t.sum.half / count);
  t.sum = {};
}

void SecondPassMeasurer::FinishTemplates() {
  if (learnt_) return;
  learnt_ = true;
  for (auto& [feature, t] : templates_) {
    if (!t.sum.full.empty()) Finish(t);
  }
}

AnchorPatch SecondPassMeasurer::WithoutItself(const Template& t,
                                              FrameIndex frame,
                                              const ModelPrediction& prediction,
                                              const Pyramid& pyramid) const {
  AnchorPatch patch;
  patch.full = t.full.Unpacked();
  patch.half = t.half.Unpacked();
  if (t.frames.size() < 2 || !std::ranges::binary_search(t.frames, frame)) return patch;
  const AnchorPatch own = CopyAnchor(pyramid, prediction.xy, windows_.back().px, prediction.warp);
  const auto count = static_cast<double>(t.frames.size());
  const auto take_out = [count](cv::Mat& mean, const cv::Mat& one) {
    cv::addWeighted(mean, count / (count - 1.0), one, -1.0 / (count - 1.0), 0.0, mean);
  };
  take_out(patch.full, own.full);
  if (!patch.half.empty()) take_out(patch.half, own.half);
  return patch;
}

void SecondPassMeasurer::Measure(const Frame& frame, std::span<const ModelPrediction> predictions) {
  const TimedPart part("measurement");
  FinishTemplates();
  const Pyramid pyramid = SmoothPyramidOf(frame, options_.patch.denoise_sigma_px);
  for (Window& window : windows_) MeasureWith(window, frame, predictions, pyramid);
  CompareWindows(frame.index, predictions);
}

void SecondPassMeasurer::MeasureWith(Window& window,
                                     const Frame& frame,
                                     std::span<const ModelPrediction> predictions,
                                     const Pyramid& pyramid) const {
  struct Task {
    const ModelPrediction* prediction;
    const Template* of_feature;
    Deformation* deformation;
    Measurement measured = {};
    std::optional<double> by_chance = {};  // the correlation with another place
  };
  const auto of_window = static_cast<std::size_t>(&window - windows_.data());
  std::vector<Task> tasks;
  for (const ModelPrediction& prediction : predictions) {
    const auto it = templates_.find(prediction.feature);
    if (it == templates_.end()) continue;
    const auto contest = contests_.find(prediction.feature);
    if (contest != contests_.end() && contest->second.winner.value_or(of_window) != of_window) {
      continue;
    }
    const auto [known, first] = window.deformations.try_emplace(prediction.feature);
    const double noise = first ? options_.patch.warp_noise : kWarpNoisePerFrame;
    known->second.covariance.diagonal().array() += noise * noise;
    tasks.push_back({&prediction, &it->second, &known->second});
  }
  const std::size_t every_other = EveryOther(window.chance.count);
  ForEachInParallel(tasks.size(), [&](std::size_t i) {
    auto& [prediction, of_feature, deformation, m, by_chance] = tasks[i];
    AnchorPatch anchor = WithoutItself(*of_feature, frame.index, *prediction, pyramid);
    anchor.warp = deformation->beyond_prediction * prediction->warp;
    anchor.warp_covariance = deformation->covariance;
    m = MeasurePatch(pyramid, anchor, prediction->xy, window.px, kBlurredNoiseFactor);
    // A template is a mean, and has next to no noise.
    const double possible =
        ExpectedCorrelation(of_feature->signal_variances[of_window], 0.0, window.noise_variance);
    const auto counts = [&](const Measurement& measured) {
      return measured.converged &&
             measured.correlation >= options_.patch.min_correlation * possible;
    };
    if (i % every_other == 0) {
      const Eigen::Vector2d start = ElsewhereThan(prediction->xy, window.px, pyramid);
      const Measurement other =
          MeasurePatch(pyramid, anchor, start, window.px, kBlurredNoiseFactor);
      if (counts(other) && (other.xy - start).norm() <= options_.patch.max_distance_px) {
        by_chance = other.correlation;
      }
    }
    m.converged = counts(m);
    if (m.converged && (m.xy - prediction->xy).norm() <= options_.patch.max_distance_px) {
      deformation->beyond_prediction = m.warp * prediction->warp.inverse();
      deformation->covariance = m.warp_covariance;
    }
  });
  for (const Task& task : tasks) {
    if (!task.by_chance) continue;
    window.chance.sum += *task.by_chance;
    window.chance.count += 1.0;
  }
  std::erase_if(tasks, [](const Task& task) { return !task.measured.converged; });
  std::vector<double> variances;
  for (const Task& task : tasks) {
    if (task.prediction->observed_in_first_pass) {
      variances.push_back(task.measured.residual_variance);
    }
  }
  constexpr std::size_t kEnough = 8;  // for a median; with fewer, that of the frame before stays
  if (variances.size() >= kEnough || window.noise_variance == 0.0) {
    window.noise_variance = Median(std::move(variances));
  }
  for (const auto& [prediction, of_feature, deformation, m, by_chance] : tasks) {
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
        std::max(window.noise_variance + kPatternShare * of_feature->signal_variances[of_window],
                 1e-12);
    s.residual = m.residual;
    s.xy = m.xy;
    s.shape = m.shape;
    window.sightings[prediction->feature].push_back(s);
  }
}

void SecondPassMeasurer::CompareWindows(FrameIndex frame,
                                        std::span<const ModelPrediction> predictions) {
  constexpr double kEnough = 12.0;
  all_contests_.squares.resize(windows_.size(), 0.0);
  for (const ModelPrediction& prediction : predictions) {
    if (!prediction.observed_in_first_pass || !templates_.contains(prediction.feature)) continue;
    Contest& contest = contests_[prediction.feature];
    if (contest.winner) continue;
    contest.squares.resize(windows_.size(), 0.0);
    for (std::size_t w = 0; w < windows_.size(); ++w) {
      const auto it = windows_[w].sightings.find(prediction.feature);
      double distance_px = options_.patch.max_distance_px;
      if (it != windows_[w].sightings.end() && it->second.back().frame == frame) {
        distance_px = std::min(distance_px, it->second.back().distance_px);
      }
      contest.squares[w] += distance_px * distance_px;
      all_contests_.squares[w] += distance_px * distance_px;
    }
    all_contests_.count += 1.0;
    contest.count += 1.0;
    if (contest.count >= kEnough) contest.winner = NearestWindow(contest, all_contests_);
  }
}

std::size_t SecondPassMeasurer::NearestWindow(const Contest& contest, const Contest& all) const {
  std::size_t nearest = 0;
  double least = 0.0;
  for (std::size_t w = 0; w < windows_.size(); ++w) {
    const double mean =
        DrawnMean(contest.squares[w], contest.count, all.squares[w] / std::max(all.count, 1.0));
    if (w > 0 && mean >= least) continue;
    least = mean;
    nearest = w;
  }
  return nearest;
}

std::map<FeatureId, const SecondPassMeasurer::Window*> SecondPassMeasurer::ChosenWindows() const {
  std::map<FeatureId, const Window*> chosen;
  for (const auto& [feature, contest] : contests_) {
    const Window& window =
        windows_[contest.winner ? *contest.winner : NearestWindow(contest, all_contests_)];
    if (window.sightings.contains(feature)) chosen[feature] = &window;
  }
  return chosen;
}

std::vector<double> SecondPassMeasurer::CorrelationsOf(FeatureId feature,
                                                       const Window& window) const {
  std::vector<double> correlations;
  for (const Sighting& s : window.sightings.at(feature)) {
    if (s.distance_px <= options_.patch.max_distance_px) correlations.push_back(s.correlation);
  }
  return correlations;
}

std::vector<Observation> SecondPassMeasurer::Finish() const {
  const std::map<FeatureId, const Window*> chosen = ChosenWindows();
  std::vector<double> squares;
  for (const auto& [feature, window] : chosen) {
    for (const Sighting& s : window->sightings.at(feature)) {
      if (s.observed_before && s.distance_px <= options_.patch.max_distance_px) {
        squares.push_back(s.mahalanobis2);
      }
    }
  }
  std::map<FeatureId, std::vector<double>> near;
  for (const auto& [feature, window] : chosen) near[feature] = CorrelationsOf(feature, *window);
  const double spread = SpreadOf(near);
  const double scale = std::max(Median(std::move(squares)) / kMedianChiSquare2, 1e-6);

  std::vector<Observation> observations;
  for (const auto& [feature, window] : chosen) {
    const std::vector<Sighting>& sightings = window->sightings.at(feature);
    const Chance& chance = window->chance;
    if (chance.count >= kEnoughChance &&
        IsChance(near.at(feature), chance.sum / chance.count, spread)) {
      continue;
    }
    std::vector<double> correlations;
    for (const Sighting& s : sightings) {
      if (s.observed_before) correlations.push_back(s.correlation);
    }
    const double least = kLeastRelativeCorrelation * Median(std::move(correlations));
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
