#include "frontend/track/subspace_tracker.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>
#include <optional>
#include <utility>

#include "frontend/core/statistics.h"
#include "frontend/energy/patch_energy.h"
#include "frontend/image/frame_offset.h"
#include "frontend/track/guide.h"
#include "frontend/track/lucas_kanade.h"
#include "frontend/track/measurement.h"
#include "frontend/track/trajectory_model.h"

namespace cohort {
namespace {

// Of so many frames the trajectory model is made; a feature may be hidden for as many.
constexpr std::size_t kModelFrames = 31;
// An anchor is where its corner was found, up to this [px]; it defines the point.
constexpr double kAnchorSigmaPx = 0.05;
// What is hidden changes at once. What has changed slowly, by this factor over what noise explains,
// is a corner where two surfaces overlap, no point of either: it does not come back.
constexpr double kSlowChange = 1.25;
// The prior of a small patch is wide, so that it guides and does not decide: this many deviations
// of the prediction, and no less than some of a pixel.
constexpr double kPriorFactor = 3.0;
constexpr double kLeastPriorPx = 0.3;
constexpr double kLeastSmallCorrelation = 0.1;
// Neighbours whose motions differ by more do not tell that of a new feature [px].
constexpr double kCommonMotionPx = 2.0;
// Of Lucas-Kanade there and back.
constexpr int kLkWindowPx = 21;
constexpr int kLkMaxLevel = 3;
constexpr double kReturnPx = 1.0;

// Templates of one feature, taken from one frame.
struct Appearance {
  Templates levels;     // for the energy
  AnchorPatch anchor;   // for the measurement
  int window_px = 0;    // of the measurement
  double light = 0.0;   // change of its brightness since; running mean
  double change = 1.0;  // of the anchor's innermost pixels, over what noise explains; running mean
  bool open = true;     // the others could not say where it is
};

class SubspaceMover final : public FeatureMover {
 public:
  SubspaceMover(const SubspaceOptions& options, const MeasurementOptions& measurement, bool joint)
      : options_(options), measure_(measurement), joint_(joint) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) override;
  void Keep(std::span<const std::uint8_t> keep) override;
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override;

 private:
  Eigen::Index features() const { return static_cast<Eigen::Index>(appearance_.size()); }
  Eigen::MatrixXd History() const;  // 2 L x F, newest first
  Appearance TakeAppearance(const Pyramid& pyramid,
                            const Pyramid& smooth,
                            const Eigen::Vector2d& xy) const;
  Eigen::Matrix2Xd Guide(const Pyramid& current) const;
  double ConfirmedContrast(const Pyramid& current, const Eigen::Matrix2Xd& x) const;
  void DeformAnchors(const Eigen::Matrix2Xd& x);
  class Differences;
  std::vector<Move> Measure(const Pyramid& current, const Eigen::Matrix2Xd& guide);
  void ThereAndBack(const Pyramid& current);
  bool Open(const TrajectoryModel::Estimate& predicted) const;
  bool Astray(std::size_t f,
              const Measurement& m,
              const TrajectoryModel::Estimate& predicted) const;
  bool Agrees(std::size_t f,
              const Measurement& m,
              const TrajectoryModel::Estimate& predicted) const;
  TrajectoryModel::Observation Seen(const Measurement& m) const;
  void Observe(std::size_t f, const Measurement& m, const Differences& differences, Move& move);
  Measurement Doubt(std::size_t f,
                    const Pyramid& current,
                    const Eigen::Vector2d& guide,
                    const TrajectoryModel::Estimate* own,
                    bool strong,
                    const Differences& differences,
                    Move& move);
  void Calibrate(const std::vector<Measurement>& measured,
                 const std::vector<std::uint8_t>& trusted,
                 const std::vector<TrajectoryModel::Estimate>& predicted);
  void FillHistory(Eigen::Index first_new);
  void Remember(const Pyramid& current, Pyramid smooth);

  SubspaceOptions options_;
  MeasurementOptions measure_;
  bool joint_;

  std::vector<Appearance> appearance_;
  std::vector<std::uint8_t> confirmed_;   // in the last frame
  std::vector<int> unexplained_;          // frames in a row: not confirmed, and hidden by nothing
  std::deque<Eigen::Matrix2Xd> history_;  // where they were in the L newest frames, newest first
  TrajectoryModel model_{kModelFrames, measure_.max_rank, measure_.perspective};
  // Where an open feature is by Lucas-Kanade, if that leads back to where it was.
  std::vector<std::optional<Eigen::Vector2d>> returned_;
  std::vector<cv::Mat> lk_previous_;
  Pyramid previous_;                // of the newest of these frames
  std::deque<Pyramid> smooth_;      // of the L newest, for measuring
  double covariance_scale_ = 10.0;  // until the cohort tells
  int calibrations_ = 0;
  double contrast_ = 0.0;  // energy that a displaced template gains [1/px]
};

Eigen::MatrixXd SubspaceMover::History() const {
  const std::size_t L =
      std::min(static_cast<std::size_t>(options_.history_length), history_.size());
  Eigen::MatrixXd history(2 * static_cast<Eigen::Index>(L), features());
  for (std::size_t l = 0; l < L; ++l) {
    history.middleRows(2 * static_cast<Eigen::Index>(l), 2) = history_[l];
  }
  return history;
}

Appearance SubspaceMover::TakeAppearance(const Pyramid& pyramid,
                                         const Pyramid& smooth,
                                         const Eigen::Vector2d& xy) const {
  Appearance appearance;
  appearance.levels = TakeTemplates(pyramid, xy, options_.template_px);
  appearance.window_px = std::max(measure_.patch.window_px, measure_.patch.wide_window_px);
  appearance.anchor = TakeAnchor(smooth, xy, measure_.patch.window_px, appearance.window_px);
  return appearance;
}

double SubspaceMover::ConfirmedContrast(const Pyramid& current, const Eigen::Matrix2Xd& x) const {
  std::vector<const Templates*> templates;
  std::vector<Eigen::Index> confirmed;
  for (Eigen::Index f = 0; f < features(); ++f) {
    const auto i = static_cast<std::size_t>(f);
    if (!confirmed_[i]) continue;
    confirmed.push_back(f);
    templates.push_back(&appearance_[i].levels);
  }
  return Contrast(current.levels[0], x(Eigen::all, confirmed), templates, options_.template_px);
}

Eigen::Matrix2Xd SubspaceMover::Guide(const Pyramid& current) const {
  const Eigen::Vector2d offset = RegisterFrames(previous_, current);
  Eigen::Matrix2Xd x = history_.front().colwise() + offset;
  const Eigen::MatrixXd history = History();

  const auto share = joint_ ? DataWeight(options_, contrast_, features()) : std::nullopt;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(features());
  if (share) {
    for (Eigen::Index f = 0; f < features(); ++f) {
      // What the last frame contradicted is led by the others until the image confirms it again.
      weights[f] = confirmed_[static_cast<std::size_t>(f)] ? *share : 0.0;
    }
  }

  std::vector<const Templates*> templates;
  for (const Appearance& appearance : appearance_) templates.push_back(&appearance.levels);
  for (int level = static_cast<int>(current.levels.size()) - 1; level >= 0; --level) {
    const double scale = std::ldexp(1.0, -level);
    const GuideEnergy energy(
        current, level, templates, history, weights, share.has_value(), options_);
    x = energy.Minimize(scale * x).x / scale;
  }
  return x;
}

// The cohort's similarity (scale and rotation) from the last frame to this one carries every
// anchor's warp along; what it misses is left to the measurement.
void SubspaceMover::DeformAnchors(const Eigen::Matrix2Xd& x) {
  const Eigen::Matrix2Xd& before = history_.front();
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(features());
  for (Eigen::Index f = 0; f < features(); ++f) {
    weights[f] = confirmed_[static_cast<std::size_t>(f)] ? 1.0 : 0.0;
  }
  double a = 1.0;  // s cos
  double b = 0.0;  // s sin
  for (int pass = 0; pass < 4 && weights.sum() >= 4.0; ++pass) {
    const Eigen::Vector2d mean_before = before * weights / weights.sum();
    const Eigen::Vector2d mean_now = x * weights / weights.sum();
    double dot = 0.0;
    double cross = 0.0;
    double square = 0.0;
    for (Eigen::Index f = 0; f < features(); ++f) {
      const Eigen::Vector2d p = before.col(f) - mean_before;
      const Eigen::Vector2d q = x.col(f) - mean_now;
      dot += weights[f] * p.dot(q);
      cross += weights[f] * (p.x() * q.y() - p.y() * q.x());
      square += weights[f] * p.squaredNorm();
    }
    if (!(square > 0.0)) break;
    a = dot / square;
    b = cross / square;
    for (Eigen::Index f = 0; f < features(); ++f) {  // towards least absolute distances
      const Eigen::Vector2d p = before.col(f) - mean_before;
      const Eigen::Vector2d q = x.col(f) - mean_now;
      const double distance =
          (q - Eigen::Vector2d(a * p.x() - b * p.y(), b * p.x() + a * p.y())).norm();
      weights[f] = confirmed_[static_cast<std::size_t>(f)] ? 1.0 / std::max(distance, 0.3) : 0.0;
    }
  }
  Eigen::Matrix2d similarity;
  similarity << a, -b, b, a;
  const double noise = measure_.patch.warp_noise * measure_.patch.warp_noise;
  for (Appearance& appearance : appearance_) {
    appearance.anchor.warp = similarity * appearance.anchor.warp;
    appearance.anchor.warp_covariance.diagonal().array() += noise;
  }
}

// How a picture differs from the anchors, beyond noise.
class SubspaceMover::Differences {
 public:
  // The noise is the cohort's own: the median over the `typical` features.
  Differences(const Pyramid& current,
              const std::vector<Appearance>& appearance,
              const std::vector<Measurement>& measured,
              const std::vector<std::uint8_t>& typical)
      : current_(current), appearance_(appearance) {
    std::vector<double> variances;
    std::vector<double> centers;
    for (std::size_t f = 0; f < measured.size(); ++f) {
      if (!typical[f] || !measured[f].converged) continue;
      variances.push_back(measured[f].residual_variance);
      centers.push_back(CenterSquare(f, Center(f, measured[f].xy)));
    }
    noise_variance_ = Median(std::move(variances));
    center_noise_ = Median(std::move(centers));
  }

  double noise_variance() const { return noise_variance_; }  // of a picture minus an anchor

  CenterDifference Center(std::size_t f, const Eigen::Vector2d& xy) const {
    return CompareCenter(current_, appearance_[f].anchor, xy);
  }

  // Is it the anchor that was measured?
  bool LooksRight(std::size_t f, const Measurement& m, const MeasurementOptions& options) const {
    const double expected = noise_variance_ + kPatternShare * appearance_[f].anchor.signal_variance;
    return m.converged && m.correlation >= options.patch.min_correlation &&
           m.residual_variance <= options.patch.max_residual_ratio * expected &&
           OfCenter(f, Center(f, m.xy), 0.0) <= options.max_center_ratio;
  }
  // An occluder pushes a patch before it, to where the feature's surroundings still look like it.
  // Then its prediction shows more than a displacement by so much explains.
  bool Pushed(std::size_t f,
              const Measurement& m,
              const Eigen::Vector2d& predicted,
              const MeasurementOptions& options) const {
    return OfCenter(f, Center(f, predicted), (m.xy - predicted).norm()) > options.max_center_ratio;
  }
  // The mean square of the innermost pixels, as a multiple of what is expected at a position known
  // to sigma_px.
  double OfCenter(std::size_t f, const CenterDifference& d, double sigma_px) const {
    const AnchorPatch& anchor = appearance_[f].anchor;
    return CenterSquare(f, d) / (center_noise_ + kPatternShare * anchor.signal_variance +
                                 anchor.mean_square_gradient * sigma_px * sigma_px);
  }

 private:
  double CenterSquare(std::size_t f, const CenterDifference& d) const {
    const double darker = d.mean - appearance_[f].light;
    return d.variance + darker * darker;
  }

  const Pyramid& current_;
  const std::vector<Appearance>& appearance_;
  double noise_variance_ = 0.0;
  double center_noise_ = 0.0;
};

// A measurement as the model takes it: half of its variance is the picture's, half the anchor's,
// which all of the track's measurements share.
TrajectoryModel::Observation SubspaceMover::Seen(const Measurement& m) const {
  return {m.xy, (0.5 * covariance_scale_ * m.shape).inverse(), false};
}

// Guide, then measure. A position is observed if the image confirms it: the large patch aligns with
// the anchor near the guide, looks like it, and arrives where the other features say that this one
// is. If not, a small patch is measured there, with the prediction as prior: the rim of the large
// one may lie on another surface or behind an occluder. What neither confirms is predicted.
std::vector<Move> SubspaceMover::Measure(const Pyramid& current, const Eigen::Matrix2Xd& guide) {
  const auto F = static_cast<std::size_t>(features());
  std::vector<Measurement> measured(F);
  std::vector<Eigen::Vector2d> starts(F, Eigen::Vector2d::Zero());
  for (std::size_t f = 0; f < F; ++f) {
    if (!confirmed_[f]) continue;  // its guide is the others' alone: Doubt has a better start
    starts[f] = returned_[f].value_or(guide.col(static_cast<Eigen::Index>(f)));
    measured[f] = MeasurePatch(
        current, appearance_[f].anchor, starts[f], appearance_[f].window_px, covariance_scale_);
  }
  const Differences differences(current, appearance_, measured, confirmed_);

  std::vector<std::uint8_t> trusted(F, 0);
  std::vector<TrajectoryModel::Observation> now(F);
  for (std::size_t f = 0; f < F; ++f) {
    const Measurement& m = measured[f];
    trusted[f] = confirmed_[f] && (m.xy - starts[f]).norm() <= measure_.patch.max_distance_px &&
                 differences.LooksRight(f, m, measure_);
    if (trusted[f]) now[f] = Seen(m);
  }
  std::vector<TrajectoryModel::Estimate> predicted = model_.Predict(now);
  const bool strong = options_.constraint == Constraint::kStrong && !predicted.empty() &&
                      static_cast<int>(history_.size()) >= std::min(4, options_.history_length);
  for (std::size_t f = 0; f < F; ++f) {
    if (trusted[f] && strong) {
      trusted[f] = Agrees(f, measured[f], predicted[f]) && !Astray(f, measured[f], predicted[f]) &&
                   !differences.Pushed(f, measured[f], predicted[f].measured_xy, measure_);
      if (!trusted[f]) now[f] = {};
    }
    // An occluder that arrives at the rim has moved the last position already.
    if (!trusted[f] && confirmed_[f] && history_.size() > 4) model_.Forget(f);
  }
  if (!predicted.empty()) {
    Calibrate(measured, trusted, predicted);
    predicted = model_.Predict(now);
  }

  std::vector<Move> moves(F);
  for (std::size_t f = 0; f < F; ++f) {
    if (trusted[f]) {
      Observe(f, measured[f], differences, moves[f]);
      continue;
    }
    measured[f] = Doubt(f,
                        current,
                        guide.col(static_cast<Eigen::Index>(f)),
                        predicted.empty() ? nullptr : &predicted[f],
                        strong,
                        differences,
                        moves[f]);
    if (moves[f].state == ObservationState::kObserved) now[f] = Seen(measured[f]);
  }
  for (std::size_t f = 0; f < predicted.size(); ++f) appearance_[f].open = Open(predicted[f]);
  const std::vector<TrajectoryModel::Estimate> fused = model_.Update(now);
  Eigen::Matrix2Xd x(2, features());
  for (std::size_t f = 0; f < F; ++f) {
    Move& move = moves[f];
    x.col(static_cast<Eigen::Index>(f)) = move.xy;
    if (fused.empty()) continue;
    x.col(static_cast<Eigen::Index>(f)) = fused[f].xy;
    // What strays more than its noise from what the others say (a corner where two surfaces
    // overlap) is worth less than its gradients promise.
    if (move.covariance) {
      move.covariance =
          PixelCovariance::From(std::max(1.0, model_.Misfit(f)) * move.covariance->Matrix());
    }
    if (measure_.fuse || move.state == ObservationState::kPredicted) move.xy = fused[f].xy;
  }
  history_.push_front(std::move(x));
  return moves;
}

void SubspaceMover::ThereAndBack(const Pyramid& current) {
  std::vector<cv::Mat> lk_current = LkPyramid(current, kLkWindowPx, kLkMaxLevel);
  std::vector<std::size_t> open;
  std::vector<cv::Point2f> starts;
  for (std::size_t f = 0; f < appearance_.size(); ++f) {
    if (!appearance_[f].open || !confirmed_[f]) continue;
    const Eigen::Vector2f xy = history_.front().col(static_cast<Eigen::Index>(f)).cast<float>();
    open.push_back(f);
    starts.emplace_back(xy.x(), xy.y());
  }
  const LkResult returned =
      TrackThereAndBack(lk_previous_, lk_current, starts, kLkWindowPx, kLkMaxLevel, kReturnPx);
  for (std::size_t i = 0; i < open.size(); ++i) {
    if (returned.found[i] == 0) continue;
    returned_[open[i]] = Eigen::Vector2d(returned.ends[i].x, returned.ends[i].y);
  }
  lk_previous_ = std::move(lk_current);
}

bool SubspaceMover::Open(const TrajectoryModel::Estimate& predicted) const {
  return std::sqrt(0.5 * predicted.measured_covariance.trace()) > measure_.max_open_px;
}

// Where the camera moves fast, the others cannot say where a new feature is, and alignment may end
// at any similar pattern nearby: so it must be where Lucas-Kanade finds it and finds back from.
bool SubspaceMover::Astray(std::size_t f,
                           const Measurement& m,
                           const TrajectoryModel::Estimate& predicted) const {
  constexpr double kSamePx = 2.0;
  if (measure_.max_open_px == 0.0 || !appearance_[f].open || !Open(predicted)) return false;
  return !returned_[f] || (m.xy - *returned_[f]).norm() > kSamePx;
}

// The distance from the prediction against what both leave open. What was not seen in the last
// frame must show more to be believed.
bool SubspaceMover::Agrees(std::size_t f,
                           const Measurement& m,
                           const TrajectoryModel::Estimate& predicted) const {
  const double max_sigma_px = confirmed_[f] ? measure_.max_sigma_px : 0.5 * measure_.max_sigma_px;
  const Eigen::Matrix2d noise = 0.5 * covariance_scale_ * m.shape;
  if (noise.trace() > max_sigma_px * max_sigma_px) return false;
  const double most = measure_.max_disagreement_sigmas;
  const double least_sigma_px = measure_.max_disagreement_px / most;
  const Eigen::Matrix2d S = predicted.measured_covariance + noise +
                            least_sigma_px * least_sigma_px * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d d = m.xy - predicted.measured_xy;
  return d.dot(S.inverse() * d) <= most * most;
}

void SubspaceMover::Observe(std::size_t f,
                            const Measurement& m,
                            const Differences& differences,
                            Move& move) {
  constexpr double kChangeRate = 0.1;
  constexpr double kLightRate = 0.3;
  constexpr double kGradientsMemory = 20.0;
  move.state = ObservationState::kObserved;
  move.xy = m.xy;
  move.residual = m.residual;
  const Eigen::Matrix2d covariance = covariance_scale_ * m.shape;
  move.covariance = PixelCovariance::From(covariance);
  Appearance& appearance = appearance_[f];
  appearance.anchor.warp = m.warp;
  appearance.anchor.warp_covariance = m.warp_covariance;
  appearance.anchor.gradients = m.gradients;
  appearance.anchor.gradients_count =
      std::min(appearance.anchor.gradients_count + 1.0, kGradientsMemory);
  if (m.window_px == measure_.patch.wide_window_px && m.window_px > measure_.patch.window_px &&
      0.5 * covariance.trace() < measure_.wide_above_px * measure_.wide_above_px) {
    appearance.window_px = measure_.patch.window_px;
    appearance.anchor.gradients_count = 0.0;
  }
  const CenterDifference center = differences.Center(f, m.xy);
  appearance.change += kChangeRate * (differences.OfCenter(f, center, 0.0) - appearance.change);
  appearance.light += kLightRate * (center.mean - appearance.light);
  unexplained_[f] = 0;
}

// What the large patch did not confirm, or what was not seen in the last frame. Returns the
// measurement if there is one.
Measurement SubspaceMover::Doubt(std::size_t f,
                                 const Pyramid& current,
                                 const Eigen::Vector2d& guide,
                                 const TrajectoryModel::Estimate* own,
                                 bool strong,
                                 const Differences& differences,
                                 Move& move) {
  int unexplained = unexplained_[f] + 1;
  move.state = ObservationState::kPredicted;
  move.xy = guide;
  if (own != nullptr) {
    const Eigen::Vector2d at = own->measured_xy;
    const double sigma = std::sqrt(0.5 * own->measured_covariance.trace());
    const Measurement large = MeasurePatch(
        current, appearance_[f].anchor, at, appearance_[f].window_px, covariance_scale_);
    const auto agrees = [&](const Measurement& m) {
      return strong ? Agrees(f, m, *own) && !Astray(f, m, *own)
                    : (m.xy - at).norm() <= measure_.patch.max_distance_px;
    };
    if (agrees(large) && differences.LooksRight(f, large, measure_) &&
        !(strong && differences.Pushed(f, large, at, measure_))) {
      Observe(f, large, differences, move);
      return large;
    }
    const double prior_px = std::max(kPriorFactor * sigma, kLeastPriorPx);
    const Measurement small = MeasurePatch(current,
                                           appearance_[f].anchor,
                                           at,
                                           measure_.small_window_px,
                                           covariance_scale_,
                                           differences.noise_variance(),
                                           Eigen::Matrix2d::Identity() / (prior_px * prior_px));
    if (small.converged && agrees(small) && small.correlation >= kLeastSmallCorrelation &&
        differences.OfCenter(f, differences.Center(f, small.xy), 0.0) <=
            measure_.max_center_ratio) {
      Observe(f, small, differences, move);
      return small;
    }
    move.xy = own->xy;
    const bool hidden =
        differences.OfCenter(f, differences.Center(f, at), sigma) > measure_.max_center_ratio;
    if (hidden) unexplained = 0;
    if (measure_.max_unexplained_frames > 0 && sigma > measure_.patch.max_distance_px) {
      move.loss = LossReason::kContradicted;
    }
  }
  unexplained_[f] = unexplained;
  if (measure_.max_unexplained_frames > 0 &&
      (unexplained > measure_.max_unexplained_frames || appearance_[f].change > kSlowChange)) {
    move.loss = LossReason::kContradicted;
  }
  return {};
}

// The inverse gradient energy gives a covariance its shape; its size depends on how the noise is
// correlated, which the blur of the lens or of the codec decides. So it is taken from the cohort:
// the distance of a measured position from its prediction has the prediction's variance and the
// picture's half of the measurement's own.
void SubspaceMover::Calibrate(const std::vector<Measurement>& measured,
                              const std::vector<std::uint8_t>& trusted,
                              const std::vector<TrajectoryModel::Estimate>& predicted) {
  constexpr std::size_t kLeastHistory = 4;
  constexpr std::size_t kLeastMeasured = 8;
  constexpr int kQuickCalibrations = 5;
  if (history_.size() < kLeastHistory) return;
  std::vector<double> squares;
  for (std::size_t f = 0; f < measured.size(); ++f) {
    if (!trusted[f]) continue;
    const Eigen::Vector2d d = measured[f].xy - predicted[f].measured_xy;
    const Eigen::Matrix2d S =
        predicted[f].measured_covariance + 0.5 * covariance_scale_ * measured[f].shape;
    squares.push_back(d.dot(S.inverse() * d));
  }
  if (squares.size() < kLeastMeasured) return;
  // The median of a chi-square with two degrees of freedom is 2 ln 2.
  const double ratio = Median(std::move(squares)) / (2.0 * std::log(2.0));
  const double rate = ++calibrations_ <= kQuickCalibrations ? 0.7 : 0.1;
  covariance_scale_ *= std::pow(ratio, rate);
}

std::vector<Move> SubspaceMover::MoveFeatures(const Pyramid& current) {
  Pyramid smooth = SmoothPyramid(current, measure_.patch.denoise_sigma_px);
  const Eigen::Matrix2Xd guide = Guide(current);
  std::vector<Move> moves;
  if (joint_ && measure_.enabled) {
    DeformAnchors(guide);
    returned_.assign(appearance_.size(), std::nullopt);
    if (measure_.max_open_px > 0.0) ThereAndBack(current);
    moves = Measure(smooth, guide);
  } else {
    for (Eigen::Index f = 0; f < features(); ++f) {
      Move move;
      move.xy = guide.col(f);
      move.residual = PatchEnergy(current.levels[0],
                                  guide.col(f),
                                  appearance_[static_cast<std::size_t>(f)].levels[0],
                                  options_.template_px);
      moves.push_back(move);
    }
    history_.push_front(guide);
  }
  for (Eigen::Index f = 0; f < features(); ++f) {
    Move& move = moves[static_cast<std::size_t>(f)];
    if (!move.xy.allFinite()) move.loss = LossReason::kDiverged;
    confirmed_[static_cast<std::size_t>(f)] = move.state == ObservationState::kObserved;
  }
  const double contrast = ConfirmedContrast(current, history_.front());
  if (contrast > 0.0) contrast_ = 0.8 * contrast_ + 0.2 * contrast;
  Remember(current, std::move(smooth));
  return moves;
}

void SubspaceMover::Remember(const Pyramid& current, Pyramid smooth) {
  previous_ = current;
  smooth_.push_front(std::move(smooth));
  const auto length = static_cast<std::size_t>(options_.history_length);
  if (history_.size() > length) history_.pop_back();
  if (smooth_.size() > length) smooth_.pop_back();
}

void SubspaceMover::Keep(std::span<const std::uint8_t> keep) {
  std::size_t kept = 0;
  for (std::size_t f = 0; f < keep.size(); ++f) {
    if (keep[f] == 0) continue;
    if (kept != f) {
      appearance_[kept] = std::move(appearance_[f]);
      confirmed_[kept] = confirmed_[f];
      unexplained_[kept] = unexplained_[f];
      for (auto& x : history_) {
        x.col(static_cast<Eigen::Index>(kept)) = x.col(static_cast<Eigen::Index>(f));
      }
    }
    ++kept;
  }
  appearance_.resize(kept);
  confirmed_.resize(kept);
  unexplained_.resize(kept);
  for (auto& x : history_) x.conservativeResize(2, static_cast<Eigen::Index>(kept));
  if (joint_) model_.Keep(keep);
}

void SubspaceMover::Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) {
  if (appearance_.empty()) {
    // The first features, or none survived: the window starts here.
    history_.clear();
    smooth_.clear();
    model_ = TrajectoryModel(kModelFrames, measure_.max_rank, measure_.perspective);
    model_.Update({});
    history_.emplace_front(2, 0);
    Remember(current, SmoothPyramid(current, measure_.patch.denoise_sigma_px));
    if (measure_.max_open_px > 0.0) lk_previous_ = LkPyramid(current, kLkWindowPx, kLkMaxLevel);
  }
  const Eigen::Index first_new = features();
  for (auto& x : history_) {
    x.conservativeResize(2, first_new + static_cast<Eigen::Index>(born.size()));
  }
  for (std::size_t i = 0; i < born.size(); ++i) {
    appearance_.push_back(TakeAppearance(current, smooth_.front(), born[i]));
    confirmed_.push_back(1);
    unexplained_.push_back(0);
    history_.front().col(first_new + static_cast<Eigen::Index>(i)) = born[i];
  }
  if (joint_) FillHistory(first_new);  // descent has no use for it
  if (contrast_ == 0.0) contrast_ = ConfirmedContrast(current, history_.front());
}

void SubspaceMover::FillHistory(Eigen::Index first_new) {
  constexpr int kNeighbours = 8;
  for (Eigen::Index f = first_new; f < features(); ++f) {
    const Eigen::Vector2d at = history_.front().col(f);
    // The nearest old features, by distance and then by birth.
    std::vector<Eigen::Index> near(static_cast<std::size_t>(first_new));
    std::iota(near.begin(), near.end(), Eigen::Index{0});
    const auto distance = [&](Eigen::Index g) {
      return (history_.front().col(g) - at).squaredNorm();
    };
    const auto count = std::min<std::size_t>(kNeighbours, near.size());
    std::partial_sort(near.begin(),
                      near.begin() + static_cast<std::ptrdiff_t>(count),
                      near.end(),
                      [&](Eigen::Index a, Eigen::Index b) {
                        return std::pair(distance(a), a) < std::pair(distance(b), b);
                      });
    std::vector<TrajectoryModel::Observation> trajectory;
    trajectory.push_back(
        {at, Eigen::Matrix2d::Identity() / (kAnchorSigmaPx * kAnchorSigmaPx), true});
    bool known = true;
    for (std::size_t l = 1; l < history_.size(); ++l) {
      Eigen::Vector2d motion = Eigen::Vector2d::Zero();
      double square = 0.0;
      double total = 0.0;
      for (std::size_t k = 0; k < count; ++k) {
        const Eigen::Index g = near[k];
        const double weight = 1.0 / (100.0 + distance(g));  // [1/px^2]
        const Eigen::Vector2d of_neighbour = history_[l].col(g) - history_[l - 1].col(g);
        motion += weight * of_neighbour;
        square += weight * of_neighbour.squaredNorm();
        total += weight;
      }
      if (total > 0.0) {
        motion /= total;
        square /= total;
      }
      known = known && square - motion.squaredNorm() <= 2.0 * kCommonMotionPx * kCommonMotionPx;
      const Eigen::Vector2d guessed = history_[l - 1].col(f) + motion;
      history_[l].col(f) = guessed;
      trajectory.emplace_back();
      if (!known) continue;
      const Measurement m = MeasurePatch(smooth_[l],
                                         appearance_[static_cast<std::size_t>(f)].anchor,
                                         guessed,
                                         measure_.patch.window_px,
                                         covariance_scale_);
      if (m.converged && m.correlation >= measure_.patch.min_correlation &&
          (m.xy - guessed).norm() <= measure_.patch.max_distance_px) {
        history_[l].col(f) = m.xy;
        trajectory.back() = Seen(m);
      }
    }
    model_.Add(trajectory);
  }
}

}  // namespace

std::unique_ptr<FeatureMover> MakeSubspaceMover(const SubspaceOptions& options,
                                                const MeasurementOptions& measurement) {
  return std::make_unique<SubspaceMover>(options, measurement, true);
}

std::unique_ptr<FeatureMover> MakeDescentMover(const SubspaceOptions& options) {
  return std::make_unique<SubspaceMover>(options, MeasurementOptions{}, false);
}

}  // namespace cohort
