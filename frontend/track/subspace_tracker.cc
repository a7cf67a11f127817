#include "frontend/track/subspace_tracker.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>
#include <utility>

#include "frontend/core/statistics.h"
#include "frontend/energy/patch_energy.h"
#include "frontend/energy/total_energy.h"
#include "frontend/image/frame_offset.h"
#include "frontend/image/sampling.h"
#include "frontend/track/measurement.h"
#include "frontend/track/optimizer.h"
#include "frontend/track/prediction.h"

namespace cohort {
namespace {

// How many frames a feature may be hidden and still be predicted from its own course before that.
constexpr int kMemoryFrames = 30;
// Not confirmed for so many frames in a row, and hidden by nothing: it is not what it was taken
// for.
constexpr int kMaxUnexplainedFrames = 4;
// What is hidden changes at once. What has changed slowly, by this factor over what noise explains,
// is a corner where two surfaces overlap, no point of either: it does not come back.
constexpr double kSlowChange = 1.25;
// The prior of a small patch is wide, so that it guides and does not decide: this many deviations
// of the prediction, and no less than some of a pixel.
constexpr double kPriorFactor = 3.0;
constexpr double kLeastPriorPx = 0.3;
// A guide so far from the prediction was led astray: the large patch is measured again.
constexpr double kAstrayPx = 2.0;
constexpr double kLeastSmallCorrelation = 0.1;

// Templates of one feature, taken from one frame.
struct Appearance {
  std::vector<std::vector<float>> levels;  // n x n on each pyramid level, for the energy
  AnchorPatch anchor;                      // for the measurement
  double light = 0.0;                      // change of its brightness since; running mean
  double change = 1.0;  // of the anchor's innermost pixels, over what noise explains; running mean
};

class SubspaceMover final : public FeatureMover {
 public:
  explicit SubspaceMover(const TrackerOptions& options)
      : options_(options.subspace),
        measure_(options.measurement),
        joint_(options.tracker == TrackerKind::kSubspace) {
    penalty_.kind = options_.penalty;
    penalty_.epsilon = options_.epsilon;
    penalty_.rank = options_.uncentered ? 4 : 3;
  }

  std::vector<Move> MoveFeatures(const Pyramid& current) override;
  void Keep(std::span<const std::uint8_t> keep) override;
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override;

 private:
  Eigen::Index features() const { return static_cast<Eigen::Index>(appearance_.size()); }
  // Of so many frames a feature's own course is made.
  std::size_t OwnFrames() const { return 2 * static_cast<std::size_t>(options_.history_length); }
  Eigen::MatrixXd History() const;  // 2 L x F, newest first
  Appearance TakeAppearance(const Pyramid& pyramid,
                            const Pyramid& smooth,
                            const Eigen::Vector2d& xy) const;
  Eigen::Matrix2Xd Guide(const Pyramid& current) const;
  double Contrast(const Pyramid& current, const Eigen::Matrix2Xd& x) const;
  void DeformAnchors(const Eigen::Matrix2Xd& x);
  class Differences;
  std::vector<Move> Measure(const Pyramid& current, const Eigen::Matrix2Xd& guide);
  double MaxDisagreement(double sigma_px) const;
  void Observe(std::size_t f, const Measurement& m, const Differences& differences, Move& move);
  void Doubt(std::size_t f,
             const Pyramid& current,
             const Eigen::Vector2d& guide,
             const Measurement& large,
             const Eigen::Matrix2Xd& x,
             const std::vector<std::uint8_t>& trusted,
             bool strong,
             const Differences& differences,
             Move& move);
  void CalibrateCovariances(std::vector<Move>& moves, const CohortPrediction& prediction);
  void FillHistory(Eigen::Index first_new);
  void Remember(const Pyramid& current, Pyramid smooth);

  SubspaceOptions options_;
  MeasurementOptions measure_;
  bool joint_;
  Penalty penalty_;

  std::vector<Appearance> appearance_;
  std::vector<std::uint8_t> confirmed_;  // in the last frame
  std::vector<int> unexplained_;         // frames in a row: not confirmed, and hidden by nothing
  CohortHistory history_;
  Pyramid previous_;                // of the newest of these frames
  std::deque<Pyramid> smooth_;      // of the L newest, for measuring
  double covariance_scale_ = 10.0;  // until the cohort tells
  bool calibrated_ = false;
  double contrast_ = 0.0;  // energy that a displaced template gains [1/px]
};

Eigen::MatrixXd SubspaceMover::History() const {
  const std::size_t L =
      std::min(static_cast<std::size_t>(options_.history_length), history_.frames());
  Eigen::MatrixXd history(2 * static_cast<Eigen::Index>(L), features());
  for (std::size_t l = 0; l < L; ++l) {
    history.middleRows(2 * static_cast<Eigen::Index>(l), 2) = history_.positions[l];
  }
  return history;
}

Appearance SubspaceMover::TakeAppearance(const Pyramid& pyramid,
                                         const Pyramid& smooth,
                                         const Eigen::Vector2d& xy) const {
  Appearance appearance;
  const int n = options_.template_px;
  double scale = 1.0;
  for (const cv::Mat& level : pyramid.levels) {
    std::vector<float> patch(static_cast<std::size_t>(n) * n);
    SamplePatch(level, xy.x() * scale, xy.y() * scale, n, patch.data());
    appearance.levels.push_back(std::move(patch));
    scale *= 0.5;
  }
  appearance.anchor = TakeAnchor(smooth, xy, measure_.window_px);
  return appearance;
}

// How steeply the energy rises around the features, so that one penalty weight m fits bright and
// dark pictures: the data term's slope grows with the contrast, the penalty's does not. Median over
// features of the mean rise at 1.5 px, per px.
double SubspaceMover::Contrast(const Pyramid& current, const Eigen::Matrix2Xd& x) const {
  constexpr double kDistancePx = 1.5;
  const int n = options_.template_px;
  std::vector<double> rises;
  for (Eigen::Index f = 0; f < features(); ++f) {
    const auto i = static_cast<std::size_t>(f);
    if (!confirmed_[i]) continue;
    const auto& patch = appearance_[i].levels[0];
    double sum = 0.0;
    for (const auto& direction : {Eigen::Vector2d(1, 0),
                                  Eigen::Vector2d(-1, 0),
                                  Eigen::Vector2d(0, 1),
                                  Eigen::Vector2d(0, -1)}) {
      sum += PatchEnergy(current.levels[0], x.col(f) + kDistancePx * direction, patch, n);
    }
    rises.push_back((sum / 4 - PatchEnergy(current.levels[0], x.col(f), patch, n)) / kDistancePx);
  }
  return Median(std::move(rises));
}

Eigen::Matrix2Xd SubspaceMover::Guide(const Pyramid& current) const {
  const Eigen::Vector2d offset = RegisterFrames(previous_, current);
  Eigen::Matrix2Xd x = history_.positions.front().colwise() + offset;
  const Eigen::MatrixXd history = History();

  const bool penalized = joint_ && options_.penalty_weight > 0.0 && contrast_ > 0.0;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(features());
  if (penalized) {
    double share = 1.0 / (options_.penalty_weight * contrast_);
    if (options_.constraint == Constraint::kStrong) share /= static_cast<double>(features());
    for (Eigen::Index f = 0; f < features(); ++f) {
      // What the last frame contradicted is led by the others until the image confirms it again.
      weights[f] = confirmed_[static_cast<std::size_t>(f)] ? share : 0.0;
    }
  }

  std::vector<const float*> patches(appearance_.size());
  for (int level = static_cast<int>(current.levels.size()) - 1; level >= 0; --level) {
    const double scale = std::ldexp(1.0, -level);
    for (std::size_t f = 0; f < patches.size(); ++f) {
      patches[f] = appearance_[f].levels[static_cast<std::size_t>(level)].data();
    }
    x *= scale;
    const cv::Mat& picture = current.levels[static_cast<std::size_t>(level)];
    if (!penalized) {
      const TotalEnergy energy(picture, patches, options_.template_px, weights, nullptr, nullptr);
      x = MinimizeSeparately(energy, x, options_.max_iterations).x;
    } else {
      const TrajectoryMatrix trajectories(scale * history, !options_.uncentered);
      Penalty penalty = penalty_;
      penalty.smoothing =
          static_cast<double>(features()) * std::pow(options_.smoothing_px * scale, 2);
      const TotalEnergy energy(
          picture, patches, options_.template_px, weights, &trajectories, &penalty);
      x = options_.optimizer == OptimizerKind::kAlgorithm1
              ? MinimizeAlgorithm1(energy, x, options_.min_iterations, options_.max_iterations).x
              : MinimizeJointly(energy, x, penalty_.rank, options_.max_iterations).x;
    }
    x /= scale;
  }
  return x;
}

// The cohort's similarity (scale and rotation) from the last frame to this one carries every
// anchor's warp along; what it misses is left to the measurement.
void SubspaceMover::DeformAnchors(const Eigen::Matrix2Xd& x) {
  const Eigen::Matrix2Xd& before = history_.positions.front();
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
  const double noise = measure_.warp_noise * measure_.warp_noise;
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
    return m.converged && m.correlation >= options.min_correlation &&
           m.residual_variance <= options.max_residual_ratio * expected &&
           OfCenter(f, Center(f, m.xy), 0.0) <= options.max_center_ratio;
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

  // Small errors of warp and interpolation leave so much of the pattern.
  static constexpr double kPatternShare = 0.04;

  const Pyramid& current_;
  const std::vector<Appearance>& appearance_;
  double noise_variance_ = 0.0;
  double center_noise_ = 0.0;
};

// Guide, then measure. A position is observed if the image confirms it: the large patch aligns with
// the anchor near the guide, looks like it, and arrives where the other features say that this one
// is. If not, a small patch is measured there, with the prediction as prior: the rim of the large
// one may lie on another surface or behind an occluder. What neither confirms is predicted.
std::vector<Move> SubspaceMover::Measure(const Pyramid& current, const Eigen::Matrix2Xd& guide) {
  const auto F = static_cast<std::size_t>(features());
  std::vector<Measurement> measured;
  for (std::size_t f = 0; f < F; ++f) {
    measured.push_back(MeasurePatch(current,
                                    appearance_[f].anchor,
                                    guide.col(static_cast<Eigen::Index>(f)),
                                    measure_.window_px,
                                    covariance_scale_));
  }
  const Differences differences(current, appearance_, measured, confirmed_);

  Eigen::Matrix2Xd x = guide;
  std::vector<std::uint8_t> trusted(F, 0);
  for (std::size_t f = 0; f < F; ++f) {
    const auto i = static_cast<Eigen::Index>(f);
    const Measurement& m = measured[f];
    trusted[f] = (m.xy - guide.col(i)).norm() <= measure_.max_distance_px &&
                 differences.LooksRight(f, m, measure_);
    if (trusted[f]) x.col(i) = m.xy;
  }
  const auto cohort =
      PredictCohort(history_, static_cast<std::size_t>(options_.history_length), x, trusted);
  const bool strong = options_.constraint == Constraint::kStrong && cohort &&
                      static_cast<int>(history_.frames()) >= std::min(4, options_.history_length);
  std::vector<std::size_t> doubtful;
  for (std::size_t f = 0; f < F; ++f) {
    const auto i = static_cast<Eigen::Index>(f);
    if (trusted[f] && strong && confirmed_[f]) {
      const double sigma = cohort->spread_px * std::sqrt(1.0 + cohort->leverage[i]);
      trusted[f] = (x.col(i) - cohort->x.col(i)).norm() <= MaxDisagreement(sigma);
    }
    // One that comes back must prove it against its own course: the cohort's window holds its
    // predictions.
    if (!trusted[f] || (strong && !confirmed_[f])) doubtful.push_back(f);
  }

  std::vector<Move> moves(F);
  for (std::size_t f = 0; f < F; ++f) {
    moves[f].residual = measured[f].residual;
    if (trusted[f]) Observe(f, measured[f], differences, moves[f]);
  }
  for (const std::size_t f : doubtful) {
    Doubt(f,
          current,
          guide.col(static_cast<Eigen::Index>(f)),
          measured[f],
          x,
          trusted,
          strong,
          differences,
          moves[f]);
  }
  if (cohort) CalibrateCovariances(moves, *cohort);
  return moves;
}

double SubspaceMover::MaxDisagreement(double sigma_px) const {
  return std::max(measure_.max_disagreement_px, measure_.max_disagreement_sigmas * sigma_px);
}

void SubspaceMover::Observe(std::size_t f,
                            const Measurement& m,
                            const Differences& differences,
                            Move& move) {
  constexpr double kChangeRate = 0.1;
  constexpr double kLightRate = 0.3;
  move.state = ObservationState::kObserved;
  move.xy = m.xy;
  move.covariance = PixelCovariance{static_cast<float>(m.shape(0, 0)),
                                    static_cast<float>(m.shape(0, 1)),
                                    static_cast<float>(m.shape(1, 1))};
  Appearance& appearance = appearance_[f];
  appearance.anchor.warp = m.warp;
  appearance.anchor.warp_covariance = m.warp_covariance;
  const CenterDifference center = differences.Center(f, m.xy);
  appearance.change += kChangeRate * (differences.OfCenter(f, center, 0.0) - appearance.change);
  appearance.light += kLightRate * (center.mean - appearance.light);
  unexplained_[f] = 0;
}

// What the large patch did not confirm, or what was not seen in the last frame.
void SubspaceMover::Doubt(std::size_t f,
                          const Pyramid& current,
                          const Eigen::Vector2d& guide,
                          const Measurement& large,
                          const Eigen::Matrix2Xd& x,
                          const std::vector<std::uint8_t>& trusted,
                          bool strong,
                          const Differences& differences,
                          Move& move) {
  // An occluder that arrives at the rim has moved the last position already.
  if (confirmed_[f] && history_.frames() > 4) history_.seen.front()[f] = 0;
  const auto own = PredictFeature(history_, OwnFrames(), x, trusted, static_cast<Eigen::Index>(f));
  int unexplained = unexplained_[f] + 1;
  move.state = ObservationState::kPredicted;
  move.covariance.reset();
  if (own) {
    const double gate = strong ? MaxDisagreement(own->sigma_px) : measure_.max_distance_px;
    if (trusted[f] && (large.xy - own->xy).norm() <= gate) {
      Observe(f, large, differences, move);
      return;
    }
    if ((guide - own->xy).norm() > kAstrayPx) {
      const Measurement again = MeasurePatch(
          current, appearance_[f].anchor, own->xy, measure_.window_px, covariance_scale_);
      if ((again.xy - own->xy).norm() <= gate && differences.LooksRight(f, again, measure_)) {
        Observe(f, again, differences, move);
        return;
      }
    }
    const Measurement small = MeasurePatch(current,
                                           appearance_[f].anchor,
                                           own->xy,
                                           measure_.small_window_px,
                                           covariance_scale_,
                                           differences.noise_variance(),
                                           std::max(kPriorFactor * own->sigma_px, kLeastPriorPx));
    if (small.converged && (small.xy - own->xy).norm() <= gate &&
        small.correlation >= kLeastSmallCorrelation &&
        differences.OfCenter(f, differences.Center(f, small.xy), 0.0) <=
            measure_.max_center_ratio) {
      Observe(f, small, differences, move);
    } else {
      move.xy = own->xy;
      const bool hidden = differences.OfCenter(f, differences.Center(f, own->xy), own->sigma_px) >
                          measure_.max_center_ratio;
      if (hidden) unexplained = 0;
      if (own->sigma_px > measure_.max_distance_px) move.loss = LossReason::kContradicted;
    }
  } else {
    move.xy = guide;
  }
  unexplained_[f] = unexplained;
  if (unexplained > kMaxUnexplainedFrames || appearance_[f].change > kSlowChange) {
    move.loss = LossReason::kContradicted;
  }
}

// The inverse gradient energy gives a covariance its shape; its size depends on how the noise is
// correlated, which the blur of the lens or of the codec decides. So it is taken from the cohort:
// the distance of a measured position from its prediction has the measurement's own variance plus
// what the prediction takes over from the history.
void SubspaceMover::CalibrateCovariances(std::vector<Move>& moves,
                                         const CohortPrediction& prediction) {
  constexpr std::size_t kLeastHistory = 5;
  if (history_.frames() >= kLeastHistory) {
    std::vector<double> squares;
    for (std::size_t f = 0; f < moves.size(); ++f) {
      if (!moves[f].covariance) continue;
      const PixelCovariance& c = *moves[f].covariance;
      const Eigen::Vector2d d = moves[f].xy - prediction.x.col(static_cast<Eigen::Index>(f));
      const double determinant = double{c.xx} * c.yy - double{c.xy} * c.xy;
      if (!(determinant > 0.0)) continue;
      squares.push_back((c.yy * d.x() * d.x() - 2.0 * c.xy * d.x() * d.y() + c.xx * d.y() * d.y()) /
                        determinant);
    }
    if (squares.size() >= 8) {
      // The median of a chi-square with two degrees of freedom is 2 ln 2. An anchor's own noise
      // shifts all positions of its track alike: the prediction does not see it, the truth does.
      const double scale =
          2.0 * Median(std::move(squares)) / (2.0 * std::log(2.0)) / (1.0 + prediction.noise_gain);
      covariance_scale_ = calibrated_ ? 0.9 * covariance_scale_ + 0.1 * scale : scale;
      calibrated_ = true;
    }
  }
  for (Move& move : moves) {
    if (!move.covariance) continue;
    PixelCovariance& c = *move.covariance;
    c.xx = static_cast<float>(c.xx * covariance_scale_);
    c.xy = static_cast<float>(c.xy * covariance_scale_);
    c.yy = static_cast<float>(c.yy * covariance_scale_);
  }
}

std::vector<Move> SubspaceMover::MoveFeatures(const Pyramid& current) {
  Pyramid smooth = SmoothPyramid(current, measure_.denoise_sigma_px);
  Eigen::Matrix2Xd guide = Guide(current);
  std::vector<Move> moves;
  if (joint_ && measure_.enabled) {
    for (Eigen::Index f = 0; f < features(); ++f) {
      if (confirmed_[static_cast<std::size_t>(f)]) continue;
      const auto own = PredictFeature(history_, OwnFrames(), guide, confirmed_, f);
      if (own) guide.col(f) = own->xy;
    }
    DeformAnchors(guide);
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
  }
  for (Move& move : moves) {
    if (!move.xy.allFinite()) move.loss = LossReason::kDiverged;
  }
  Eigen::Matrix2Xd x(2, features());
  for (Eigen::Index f = 0; f < features(); ++f) {
    const Move& move = moves[static_cast<std::size_t>(f)];
    x.col(f) = move.xy;
    confirmed_[static_cast<std::size_t>(f)] = move.state == ObservationState::kObserved;
  }
  const double contrast = Contrast(current, x);
  if (contrast > 0.0) contrast_ = 0.8 * contrast_ + 0.2 * contrast;
  history_.positions.push_front(std::move(x));
  history_.seen.push_front(confirmed_);
  Remember(current, std::move(smooth));
  return moves;
}

void SubspaceMover::Remember(const Pyramid& current, Pyramid smooth) {
  previous_ = current;
  smooth_.push_front(std::move(smooth));
  const auto length = static_cast<std::size_t>(options_.history_length);
  if (history_.frames() > length + static_cast<std::size_t>(kMemoryFrames)) {
    history_.positions.pop_back();
    history_.seen.pop_back();
  }
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
      for (auto& seen : history_.seen) seen[kept] = seen[f];
      for (auto& x : history_.positions) {
        x.col(static_cast<Eigen::Index>(kept)) = x.col(static_cast<Eigen::Index>(f));
      }
    }
    ++kept;
  }
  appearance_.resize(kept);
  confirmed_.resize(kept);
  unexplained_.resize(kept);
  for (auto& seen : history_.seen) seen.resize(kept);
  for (auto& x : history_.positions) x.conservativeResize(2, static_cast<Eigen::Index>(kept));
}

void SubspaceMover::Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) {
  if (appearance_.empty()) {
    // The first features, or none survived: the window starts here.
    history_ = {};
    smooth_.clear();
    history_.positions.emplace_front(2, 0);
    history_.seen.emplace_front();
    Remember(current, SmoothPyramid(current, measure_.denoise_sigma_px));
  }
  const Eigen::Index first_new = features();
  for (auto& seen : history_.seen) seen.resize(seen.size() + born.size(), 0);
  for (auto& x : history_.positions) {
    x.conservativeResize(2, first_new + static_cast<Eigen::Index>(born.size()));
  }
  for (std::size_t i = 0; i < born.size(); ++i) {
    appearance_.push_back(TakeAppearance(current, smooth_.front(), born[i]));
    confirmed_.push_back(1);
    unexplained_.push_back(0);
    history_.positions.front().col(first_new + static_cast<Eigen::Index>(i)) = born[i];
  }
  std::fill(history_.seen.front().end() - static_cast<std::ptrdiff_t>(born.size()),
            history_.seen.front().end(),
            std::uint8_t{1});
  if (joint_) FillHistory(first_new);  // descent has no use for it
  if (contrast_ == 0.0) contrast_ = Contrast(current, history_.positions.front());
}

void SubspaceMover::FillHistory(Eigen::Index first_new) {
  constexpr int kNeighbours = 8;
  for (Eigen::Index f = first_new; f < features(); ++f) {
    const Eigen::Vector2d at = history_.positions.front().col(f);
    // The nearest old features, by distance and then by birth.
    std::vector<Eigen::Index> near(static_cast<std::size_t>(first_new));
    std::iota(near.begin(), near.end(), Eigen::Index{0});
    const auto distance = [&](Eigen::Index g) {
      return (history_.positions.front().col(g) - at).squaredNorm();
    };
    const auto count = std::min<std::size_t>(kNeighbours, near.size());
    std::partial_sort(near.begin(),
                      near.begin() + static_cast<std::ptrdiff_t>(count),
                      near.end(),
                      [&](Eigen::Index a, Eigen::Index b) {
                        return std::pair(distance(a), a) < std::pair(distance(b), b);
                      });
    for (std::size_t l = 1; l < history_.frames(); ++l) {
      if (l >= smooth_.size()) {  // beyond the window of the energy: not known
        history_.positions[l].col(f) = history_.positions[l - 1].col(f);
        continue;
      }
      Eigen::Vector2d motion = Eigen::Vector2d::Zero();
      double total = 0.0;
      for (std::size_t k = 0; k < count; ++k) {
        const Eigen::Index g = near[k];
        const double weight = 1.0 / (100.0 + distance(g));  // [1/px^2]
        motion += weight * (history_.positions[l].col(g) - history_.positions[l - 1].col(g));
        total += weight;
      }
      Eigen::Vector2d x = history_.positions[l - 1].col(f);
      if (total > 0.0) x += motion / total;
      const Measurement m = MeasurePatch(smooth_[l],
                                         appearance_[static_cast<std::size_t>(f)].anchor,
                                         x,
                                         measure_.window_px,
                                         covariance_scale_);
      if (m.converged && m.correlation >= measure_.min_correlation &&
          (m.xy - x).norm() <= measure_.max_distance_px) {
        x = m.xy;
        history_.seen[l][static_cast<std::size_t>(f)] = 1;
      }
      history_.positions[l].col(f) = x;
    }
  }
}

}  // namespace

std::unique_ptr<FeatureMover> MakeSubspaceMover(const TrackerOptions& options) {
  return std::make_unique<SubspaceMover>(options);
}

}  // namespace cohort
