#include "pipelines/evaluation/track_error.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>

#include "frontend/core/error.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr double kOutlierPx = 3.0;
constexpr std::array<int, 6> kHiddenFrames{0, 1, 5, 10, 20, 50};
using ErrorsByFramesHidden = std::map<int, std::vector<double>>;

// A track from its first observed position on, with its true path.
struct AnchoredTrack {
  std::span<const Observation> observations;  // the first one is the anchor
  std::span<const FrameIndex> frames;         // of the clip, from the anchor's on
  TruePath path;
};

std::optional<AnchoredTrack> AnchorTrack(const TrackSet& tracks,
                                         std::span<const FrameIndex> frames,
                                         FeatureId feature,
                                         const TrackTruthOracle& truth) {
  const auto track = tracks.Track(feature);
  const auto anchor = std::find_if(track.begin(), track.end(), [](const Observation& o) {
    return o.state == ObservationState::kObserved;
  });
  if (anchor == track.end()) return std::nullopt;
  auto path = truth(anchor->frame, anchor->xy);
  if (!path) return std::nullopt;
  const auto first = std::lower_bound(frames.begin(), frames.end(), anchor->frame);
  return AnchoredTrack{.observations = {anchor, track.end()},
                       .frames = {first, frames.end()},
                       .path = std::move(*path)};
}

// Returns nullopt without errors.
std::optional<ErrorSummary> SummarizeErrors(const std::vector<double>& errors_px) {
  if (errors_px.empty()) return std::nullopt;
  return ErrorSummary{.count = errors_px.size(),
                      .median_px = InterpolatedMedian(errors_px),
                      .p90_px = InterpolatedQuantile(errors_px, 0.9),
                      .mean_px = std::accumulate(errors_px.begin(), errors_px.end(), 0.0) /
                                 static_cast<double>(errors_px.size())};
}

std::map<int, ErrorSummary> SummarizeByFramesHidden(const ErrorsByFramesHidden& errors_px) {
  std::map<int, ErrorSummary> summaries;
  for (const int frames : kHiddenFrames) {
    const auto found = errors_px.find(frames);
    if (found != errors_px.end()) summaries[frames] = *SummarizeErrors(found->second);
  }
  return summaries;
}

bool InsideBorder(const Eigen::Vector2d& xy, const ReinitializationOptions& options) {
  return xy.x() >= options.border_px && xy.y() >= options.border_px &&
         xy.x() <= options.width_px - 1 - options.border_px &&
         xy.y() <= options.height_px - 1 - options.border_px;
}

// L^-1 error; the covariance is positive definite.
Eigen::Vector2d Normalise(const Eigen::Vector2d& error, const PixelCovariance& covariance) {
  return covariance.Matrix().llt().matrixL().solve(error);
}

// L^-1 d, and the standard deviation according to S.
struct NormalisedError {
  Eigen::Vector2d error;
  double claimed_px = 0.0;
};

// Adds a track's errors about their own median, normalised. With n errors, the median removes one
// n-th of their variance.
void AddNormalised(const std::vector<std::pair<Eigen::Vector2d, PixelCovariance>>& errors,
                   std::vector<NormalisedError>& normalised) {
  const auto n = static_cast<double>(errors.size());
  if (n < 2.0) return;
  Eigen::Vector2d median;
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> values;
    for (const auto& [error, covariance] : errors) values.push_back(error[axis]);
    median[axis] = InterpolatedMedian(std::move(values));
  }
  for (const auto& [error, covariance] : errors) {
    normalised.push_back({std::sqrt(n / (n - 1.0)) * Normalise(error - median, covariance),
                          std::sqrt(0.5 * (double{covariance.xx} + double{covariance.yy}))});
  }
}

double NeesRatio(std::vector<double> squares) {
  return InterpolatedMedian(std::move(squares)) / (2.0 * std::numbers::ln2);
}

std::vector<CalibrationFigure::Tenth> Tenths(std::vector<NormalisedError> normalised) {
  constexpr std::size_t kEnough = 1000;
  if (normalised.size() < kEnough) return {};
  std::stable_sort(
      normalised.begin(), normalised.end(), [](const NormalisedError& a, const NormalisedError& b) {
        return a.claimed_px < b.claimed_px;
      });
  std::vector<CalibrationFigure::Tenth> tenths;
  for (std::size_t tenth = 0; tenth < 10; ++tenth) {
    std::vector<double> claimed_px;
    std::vector<double> squares;
    for (std::size_t i = tenth * normalised.size() / 10; i < (tenth + 1) * normalised.size() / 10;
         ++i) {
      claimed_px.push_back(normalised[i].claimed_px);
      squares.push_back(normalised[i].error.squaredNorm());
    }
    tenths.push_back({InterpolatedMedian(std::move(claimed_px)), NeesRatio(std::move(squares))});
  }
  return tenths;
}

CalibrationFigure Calibration(const std::vector<NormalisedError>& normalised) {
  CalibrationFigure figure;
  figure.count = normalised.size();
  std::vector<double> squares;
  std::vector<double> sizes;
  std::size_t beyond = 0;
  const double bins_per_sigma =
      CalibrationFigure::kHistogramBins / (2.0 * CalibrationFigure::kHistogramSigmas);
  for (const auto& [e, claimed_px] : normalised) {
    squares.push_back(e.squaredNorm());
    for (const double x : {e.x(), e.y()}) {
      sizes.push_back(std::abs(x));
      if (std::abs(x) > 3.0) ++beyond;
      const double bin = std::floor((x + CalibrationFigure::kHistogramSigmas) * bins_per_sigma);
      if (bin >= 0.0 && bin < CalibrationFigure::kHistogramBins) {
        ++figure.histogram[static_cast<std::size_t>(bin)];
      }
    }
  }
  constexpr double kNormalMadToSigma = 1.4826;
  figure.nees_ratio = NeesRatio(std::move(squares));
  figure.share_beyond_3 = static_cast<double>(beyond) / static_cast<double>(sizes.size());
  figure.robust_sigma = kNormalMadToSigma * InterpolatedMedian(std::move(sizes));
  figure.tenths = Tenths(normalised);
  return figure;
}

std::optional<double> Ratio(std::size_t part, std::size_t whole) {
  if (whole == 0) return std::nullopt;
  return static_cast<double>(part) / static_cast<double>(whole);
}

// The errors of all positions, by the state that the tracker gave them and by how long the point
// was hidden.
struct PositionErrors {
  std::vector<double> observed_px;
  std::vector<double> hidden_but_observed_px;
  ErrorsByFramesHidden predicted_px;
  ErrorsByFramesHidden hidden_px;
  std::vector<NormalisedError> normalised;  // AddNormalised
  std::size_t predicted = 0;
  std::size_t hidden = 0;
  std::size_t predicted_and_hidden = 0;

  void AddTrack(const AnchoredTrack& track);

 private:
  void AddPosition(ObservationState state, double error_px, int hidden_frames);
};

void PositionErrors::AddTrack(const AnchoredTrack& track) {
  int hidden_frames = 0;
  std::vector<std::pair<Eigen::Vector2d, PixelCovariance>> errors;
  if (const auto& covariance = track.observations.front().covariance) {
    errors.emplace_back(Eigen::Vector2d::Zero(), *covariance);
  }
  auto observation = track.observations.begin() + 1;
  for (const FrameIndex frame : track.frames.subspan(1)) {
    if (observation == track.observations.end()) break;
    const auto sighting = track.path(frame);
    if (sighting) hidden_frames = sighting->visible ? 0 : hidden_frames + 1;
    if (observation->frame != frame) continue;
    const Observation& o = *observation;
    ++observation;
    if (!sighting) continue;
    const Eigen::Vector2d error = o.xy - sighting->xy;
    if (o.state == ObservationState::kObserved && o.covariance) {
      errors.emplace_back(error, *o.covariance);
    }
    AddPosition(o.state, error.norm(), hidden_frames);
  }
  AddNormalised(errors, normalised);
}

void PositionErrors::AddPosition(ObservationState state, double error_px, int hidden_frames) {
  const bool is_predicted = state == ObservationState::kPredicted;
  if (is_predicted) ++predicted;
  if (hidden_frames > 0) {
    ++hidden;
    if (is_predicted) ++predicted_and_hidden;
    if (!is_predicted) hidden_but_observed_px.push_back(error_px);
    hidden_px[hidden_frames].push_back(error_px);
  }
  (is_predicted ? predicted_px[hidden_frames] : observed_px).push_back(error_px);
}

}  // namespace

ReinitializationFigure MeasureReinitializations(const TrackSet& tracks,
                                                std::span<const FrameIndex> frames,
                                                const TrackTruthOracle& truth,
                                                const ReinitializationOptions& options) {
  Check(options.width_px > 0 && options.height_px > 0, "the image size is known");
  ReinitializationFigure figure;
  for (const FeatureId feature : tracks.features()) {
    const auto track = AnchorTrack(tracks, frames, feature, truth);
    if (!track) continue;
    auto observation = track->observations.begin() + 1;
    for (const FrameIndex frame : track->frames.subspan(1)) {
      const auto sighting = track->path(frame);
      const bool visible = sighting && sighting->visible;
      if (observation == track->observations.end()) {
        if (visible && InsideBorder(sighting->xy, options)) ++figure.reinitializations;
        break;
      }
      if (observation->frame != frame) continue;  // a gap in an imported track
      const Eigen::Vector2d xy = observation->xy;
      ++observation;
      if (!visible) continue;
      if ((xy - sighting->xy).norm() > options.limit_px) {
        ++figure.reinitializations;
        break;
      }
      ++figure.frames;
    }
  }
  figure.mean_frames_between = Ratio(figure.frames, figure.reinitializations);
  return figure;
}

std::optional<TrajectoryL1Figure> MeasureTrajectoryL1(const TrackSet& tracks,
                                                      std::span<const FrameIndex> frames,
                                                      const TrackTruthOracle& truth,
                                                      std::size_t count) {
  if (tracks.frames().empty()) return std::nullopt;
  const auto begin = std::ranges::lower_bound(frames, tracks.frames().front());
  if (frames.end() - begin <= static_cast<std::ptrdiff_t>(count)) return std::nullopt;
  TrajectoryL1Figure figure;
  for (const Observation* first : tracks.InFrame(tracks.frames().front())) {
    const auto track = AnchorTrack(tracks, frames, first->feature, truth);
    if (!track || track->observations.front().frame != first->frame) continue;
    double sum_px = 0.0;
    bool always_visible = true;
    auto observation = track->observations.begin();
    for (const FrameIndex frame : track->frames.subspan(1, count)) {
      const auto next = observation + 1;
      if (next != track->observations.end() && next->frame == frame) observation = next;
      const auto sighting = track->path(frame);
      always_visible = sighting && sighting->visible;
      if (!always_visible) break;
      sum_px += (observation->xy - sighting->xy).lpNorm<1>();
    }
    if (!always_visible) continue;
    ++figure.tracks;
    figure.mean_px += sum_px;
  }
  if (figure.tracks == 0) return std::nullopt;
  figure.mean_px /= static_cast<double>(figure.tracks);
  return figure;
}

TrackEvaluation EvaluateTracks(const TrackSet& tracks,
                               std::span<const FrameIndex> frames,
                               const TrackTruthOracle& truth,
                               const ReinitializationOptions& options) {
  TrackEvaluation evaluation;
  PositionErrors errors;
  for (const FeatureId feature : tracks.features()) {
    ++evaluation.tracks;
    if (const auto track = AnchorTrack(tracks, frames, feature, truth)) {
      errors.AddTrack(*track);
    } else {
      ++evaluation.tracks_without_truth;
    }
  }
  if (!errors.normalised.empty()) evaluation.calibration = Calibration(errors.normalised);
  const auto outliers = std::count_if(errors.observed_px.begin(),
                                      errors.observed_px.end(),
                                      [](double error_px) { return error_px > kOutlierPx; });
  evaluation.outlier_share = Ratio(static_cast<std::size_t>(outliers), errors.observed_px.size());
  evaluation.observed = SummarizeErrors(errors.observed_px);
  evaluation.predicted = SummarizeByFramesHidden(errors.predicted_px);
  evaluation.hidden = SummarizeByFramesHidden(errors.hidden_px);
  evaluation.hidden_but_observed = SummarizeErrors(errors.hidden_but_observed_px);
  evaluation.predicted_precision = Ratio(errors.predicted_and_hidden, errors.predicted);
  evaluation.predicted_recall = Ratio(errors.predicted_and_hidden, errors.hidden);
  evaluation.reinitializations = MeasureReinitializations(tracks, frames, truth, options);
  evaluation.trajectory_l1 = MeasureTrajectoryL1(tracks, frames, truth);
  return evaluation;
}

}  // namespace cohort
