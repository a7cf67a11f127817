#include "frontend/track/subspace_tracker.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>
#include <utility>

#include "frontend/energy/patch_energy.h"
#include "frontend/energy/total_energy.h"
#include "frontend/image/frame_offset.h"
#include "frontend/image/sampling.h"
#include "frontend/track/measurement.h"
#include "frontend/track/optimizer.h"

namespace cohort {
namespace {

double Median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Templates of one feature, taken from one frame.
struct Appearance {
  std::vector<std::vector<float>> levels;  // n x n on each pyramid level, for the energy
  AnchorPatch anchor;                      // for the measurement
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
  Eigen::MatrixXd History() const;  // 2 L x F, newest first
  Appearance TakeAppearance(const Pyramid& pyramid,
                            const Pyramid& smooth,
                            const Eigen::Vector2d& xy) const;
  Eigen::Matrix2Xd Guide(const Pyramid& current) const;
  double Contrast(const Pyramid& current, const Eigen::Matrix2Xd& x) const;
  void DeformAnchors(const Eigen::Matrix2Xd& x);
  std::vector<Move> Measure(const Pyramid& current, const Eigen::Matrix2Xd& guide);
  struct Prediction {
    Eigen::Matrix2Xd x;       // 2 x F; no columns: unknown
    double spread_px = 0.0;   // typical distance of the trusted features from it, a coordinate
    double noise_gain = 0.0;  // variance that it takes over from the history, a coordinate
    // How far a feature's history lies outside the trusted ones', as its leverage in the
    // regression: about 3 / C for one of C trusted features, large for one that would be
    // extrapolated.
    Eigen::VectorXd leverage;
    bool known() const { return x.cols() > 0; }
  };
  Prediction Predict(const Eigen::Matrix2Xd& x, const std::vector<std::uint8_t>& trusted) const;
  void LeadByTheOthers(std::vector<Move>& moves);
  void CalibrateCovariances(std::vector<Move>& moves, const Prediction& prediction);
  void FillHistory(Eigen::Index first_new);
  void Remember(const Pyramid& current, Pyramid smooth);

  SubspaceOptions options_;
  MeasurementOptions measure_;
  bool joint_;
  Penalty penalty_;

  std::vector<Appearance> appearance_;
  std::vector<std::uint8_t> confirmed_;     // in the last frame
  std::deque<Eigen::Matrix2Xd> positions_;  // newest first, at most L, each 2 x F
  Pyramid previous_;                        // of the newest of these frames
  std::deque<Pyramid> smooth_;              // of all of them, for measuring
  double covariance_scale_ = 10.0;          // until the cohort tells
  bool calibrated_ = false;
  double contrast_ = 0.0;  // energy that a displaced template gains [1/px]
};

Eigen::MatrixXd SubspaceMover::History() const {
  Eigen::MatrixXd history(2 * static_cast<Eigen::Index>(positions_.size()), features());
  for (std::size_t l = 0; l < positions_.size(); ++l) {
    history.middleRows(2 * static_cast<Eigen::Index>(l), 2) = positions_[l];
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
  Eigen::Matrix2Xd x = positions_.front().colwise() + offset;
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
  const Eigen::Matrix2Xd& before = positions_.front();
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

std::vector<Move> SubspaceMover::Measure(const Pyramid& current, const Eigen::Matrix2Xd& guide) {
  const auto F = static_cast<std::size_t>(features());
  std::vector<Move> moves(F);
  std::vector<Measurement> measured(F);
  std::vector<double> variances;
  for (std::size_t f = 0; f < F; ++f) {
    measured[f] = MeasurePatch(current,
                               appearance_[f].anchor,
                               guide.col(static_cast<Eigen::Index>(f)),
                               measure_.window_px,
                               covariance_scale_);
    if (measured[f].converged) variances.push_back(measured[f].residual_variance);
  }
  const double noise_variance = Median(std::move(variances));  // of a difference: twice a picture's
  for (std::size_t f = 0; f < F; ++f) {
    const Measurement& m = measured[f];
    const Eigen::Vector2d start = guide.col(static_cast<Eigen::Index>(f));
    // Noise, and what the small errors of warp and interpolation leave of the pattern.
    const double expected = noise_variance + 0.04 * appearance_[f].anchor.signal_variance;
    const bool seen = m.converged && (m.xy - start).norm() <= measure_.max_distance_px &&
                      m.correlation >= measure_.min_correlation &&
                      m.residual_variance <= measure_.max_residual_ratio * expected;
    moves[f].residual = m.residual;
    if (seen) {
      moves[f].xy = m.xy;
      moves[f].covariance = PixelCovariance{static_cast<float>(m.shape(0, 0)),
                                            static_cast<float>(m.shape(0, 1)),
                                            static_cast<float>(m.shape(1, 1))};
      appearance_[f].anchor.warp = m.warp;
      appearance_[f].anchor.warp_covariance = m.warp_covariance;
    } else {
      moves[f].xy = start;
      moves[f].state = ObservationState::kPredicted;
    }
  }
  return moves;
}

// Where the other features say that each one is: the current position as an affine function of the
// history, x_f = A h_f + c, fitted to the trusted features by ridge regression with Tukey's
// weights. The ridge is the history's noise, so that directions which noise alone spans do not
// count; how many dimensions are left follows from the motion. Empty where too few are trusted.
SubspaceMover::Prediction SubspaceMover::Predict(const Eigen::Matrix2Xd& x,
                                                 const std::vector<std::uint8_t>& trusted) const {
  constexpr Eigen::Index kLeastTrusted = 8;
  std::vector<Eigen::Index> chosen;
  for (Eigen::Index f = 0; f < features(); ++f) {
    if (trusted[static_cast<std::size_t>(f)]) chosen.push_back(f);
  }
  const auto C = static_cast<Eigen::Index>(chosen.size());
  Prediction prediction;
  if (C < kLeastTrusted) return prediction;
  const Eigen::MatrixXd history = History();
  const Eigen::MatrixXd B = history(Eigen::all, chosen);
  const Eigen::Matrix2Xd X = x(Eigen::all, chosen);

  Eigen::VectorXd weights = Eigen::VectorXd::Ones(C);
  for (int pass = 0; pass < 4; ++pass) {
    const double total = weights.sum();
    const Eigen::VectorXd mean_h = B * weights / total;
    const Eigen::Vector2d mean_x = X * weights / total;
    const Eigen::MatrixXd B0 = B.colwise() - mean_h;
    const Eigen::MatrixXd BW = B0 * weights.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(BW * B0.transpose());
    const Eigen::VectorXd& lambda = eigen.eigenvalues();
    // The lower half of the spectrum is noise (at least 0.02 px, where it is too short to tell).
    const double ridge = std::max(lambda[lambda.size() / 2 - 1], total * 4e-4);
    const Eigen::VectorXd inverse = (lambda.array() + ridge).inverse();
    const Eigen::MatrixXd XB = (X.colwise() - mean_x) * BW.transpose();
    const Eigen::MatrixXd& U = eigen.eigenvectors();
    const Eigen::MatrixXd A = XB * U * inverse.asDiagonal() * U.transpose();
    prediction.noise_gain = 0.5 * A.squaredNorm();
    prediction.x = (A * (history.colwise() - mean_h)).colwise() + mean_x;

    const Eigen::MatrixXd projected =
        inverse.cwiseSqrt().asDiagonal() * U.transpose() * (history.colwise() - mean_h);
    prediction.leverage = projected.colwise().squaredNorm();

    std::vector<double> errors;
    for (Eigen::Index i = 0; i < C; ++i) {
      errors.push_back((prediction.x.col(chosen[static_cast<std::size_t>(i)]) - X.col(i)).norm());
    }
    prediction.spread_px = std::max(0.85 * Median(errors), 0.02);  // of one coordinate, if Gaussian
    for (Eigen::Index i = 0; i < C; ++i) {
      const double u = errors[static_cast<std::size_t>(i)] / (6.0 * prediction.spread_px);
      weights[i] = u < 1.0 ? (1.0 - u * u) * (1.0 - u * u) : 0.0;
    }
    if (weights.sum() < kLeastTrusted / 2.0) break;
  }
  return prediction;
}

// The inverse gradient energy gives a covariance its shape; its size depends on how the noise is
// correlated, which the blur of the lens or of the codec decides. So it is taken from the cohort:
// the distance of a measured position from its prediction has the measurement's own variance plus
// what the prediction takes over from the history.
void SubspaceMover::CalibrateCovariances(std::vector<Move>& moves, const Prediction& prediction) {
  constexpr std::size_t kLeastHistory = 5;
  if (positions_.size() >= kLeastHistory) {
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

// What the image shows, but not where the cohort goes, is something else that looks alike or an
// occluder that carries the feature away: it is predicted like what the image does not show.
void SubspaceMover::LeadByTheOthers(std::vector<Move>& moves) {
  Eigen::Matrix2Xd x(2, features());
  std::vector<std::uint8_t> trusted(moves.size());
  for (std::size_t f = 0; f < moves.size(); ++f) {
    x.col(static_cast<Eigen::Index>(f)) = moves[f].xy;
    trusted[f] = moves[f].state == ObservationState::kObserved;
  }
  const Prediction prediction = Predict(x, trusted);
  if (!prediction.known()) return;
  CalibrateCovariances(moves, prediction);
  const bool strong = options_.constraint == Constraint::kStrong &&
                      static_cast<int>(positions_.size()) >= std::min(4, options_.history_length);
  const double limit = std::max(measure_.max_disagreement_px, 6.0 * prediction.spread_px);
  for (std::size_t f = 0; f < moves.size(); ++f) {
    const Eigen::Vector2d predicted = prediction.x.col(static_cast<Eigen::Index>(f));
    if (strong && trusted[f] && (moves[f].xy - predicted).norm() > limit) {
      moves[f].state = ObservationState::kPredicted;
      moves[f].covariance.reset();
    }
    if (moves[f].state == ObservationState::kObserved) continue;
    moves[f].xy = predicted;
    // A course that no other feature shares cannot be predicted: its expected error says so.
    const double leverage = prediction.leverage[static_cast<Eigen::Index>(f)];
    if (prediction.spread_px * std::sqrt(leverage) > measure_.max_distance_px) {
      moves[f].loss = LossReason::kContradicted;
    }
  }
}

std::vector<Move> SubspaceMover::MoveFeatures(const Pyramid& current) {
  Pyramid smooth = SmoothPyramid(current, measure_.denoise_sigma_px);
  Eigen::Matrix2Xd guide = Guide(current);
  std::vector<Move> moves;
  if (measure_.enabled) {
    if (joint_) {
      const Prediction prediction = Predict(guide, confirmed_);
      for (Eigen::Index f = 0; f < features() && prediction.known(); ++f) {
        if (!confirmed_[static_cast<std::size_t>(f)]) guide.col(f) = prediction.x.col(f);
      }
    }
    DeformAnchors(guide);
    moves = Measure(smooth, guide);
    if (joint_) LeadByTheOthers(moves);
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
  positions_.push_front(std::move(x));
  Remember(current, std::move(smooth));
  return moves;
}

void SubspaceMover::Remember(const Pyramid& current, Pyramid smooth) {
  previous_ = current;
  smooth_.push_front(std::move(smooth));
  const auto length = static_cast<std::size_t>(options_.history_length);
  if (positions_.size() > length) positions_.pop_back();
  if (smooth_.size() > length) smooth_.pop_back();
}

void SubspaceMover::Keep(std::span<const std::uint8_t> keep) {
  std::size_t kept = 0;
  for (std::size_t f = 0; f < keep.size(); ++f) {
    if (keep[f] == 0) continue;
    if (kept != f) {
      appearance_[kept] = std::move(appearance_[f]);
      confirmed_[kept] = confirmed_[f];
      for (auto& x : positions_) {
        x.col(static_cast<Eigen::Index>(kept)) = x.col(static_cast<Eigen::Index>(f));
      }
    }
    ++kept;
  }
  appearance_.resize(kept);
  confirmed_.resize(kept);
  for (auto& x : positions_) x.conservativeResize(2, static_cast<Eigen::Index>(kept));
}

void SubspaceMover::Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) {
  if (appearance_.empty()) {
    // The first features, or none survived: the window starts here.
    positions_.clear();
    smooth_.clear();
    positions_.emplace_front(2, 0);
    Remember(current, SmoothPyramid(current, measure_.denoise_sigma_px));
  }
  const Eigen::Index first_new = features();
  for (auto& x : positions_) {
    x.conservativeResize(2, first_new + static_cast<Eigen::Index>(born.size()));
  }
  for (std::size_t i = 0; i < born.size(); ++i) {
    appearance_.push_back(TakeAppearance(current, smooth_.front(), born[i]));
    confirmed_.push_back(1);
    positions_.front().col(first_new + static_cast<Eigen::Index>(i)) = born[i];
  }
  FillHistory(first_new);
  if (contrast_ == 0.0) contrast_ = Contrast(current, positions_.front());
}

void SubspaceMover::FillHistory(Eigen::Index first_new) {
  constexpr int kNeighbours = 8;
  for (Eigen::Index f = first_new; f < features(); ++f) {
    const Eigen::Vector2d at = positions_.front().col(f);
    // The nearest old features, by distance and then by birth.
    std::vector<Eigen::Index> near(static_cast<std::size_t>(first_new));
    std::iota(near.begin(), near.end(), Eigen::Index{0});
    const auto distance = [&](Eigen::Index g) {
      return (positions_.front().col(g) - at).squaredNorm();
    };
    const auto count = std::min<std::size_t>(kNeighbours, near.size());
    std::partial_sort(near.begin(),
                      near.begin() + static_cast<std::ptrdiff_t>(count),
                      near.end(),
                      [&](Eigen::Index a, Eigen::Index b) {
                        return std::pair(distance(a), a) < std::pair(distance(b), b);
                      });
    for (std::size_t l = 1; l < positions_.size(); ++l) {
      Eigen::Vector2d motion = Eigen::Vector2d::Zero();
      double total = 0.0;
      for (std::size_t k = 0; k < count; ++k) {
        const Eigen::Index g = near[k];
        const double weight = 1.0 / (100.0 + distance(g));  // [1/px^2]
        motion += weight * (positions_[l].col(g) - positions_[l - 1].col(g));
        total += weight;
      }
      Eigen::Vector2d x = positions_[l - 1].col(f);
      if (total > 0.0) x += motion / total;
      const Measurement m = MeasurePatch(smooth_[l],
                                         appearance_[static_cast<std::size_t>(f)].anchor,
                                         x,
                                         measure_.window_px,
                                         covariance_scale_);
      if (m.converged && m.correlation >= measure_.min_correlation &&
          (m.xy - x).norm() <= measure_.max_distance_px) {
        x = m.xy;
      }
      positions_[l].col(f) = x;
    }
  }
}

}  // namespace

std::unique_ptr<FeatureMover> MakeSubspaceMover(const TrackerOptions& options) {
  return std::make_unique<SubspaceMover>(options);
}

}  // namespace cohort
