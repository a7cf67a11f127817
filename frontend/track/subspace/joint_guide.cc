#include "frontend/track/subspace/joint_guide.h"

#include <cmath>
#include <utility>

#include "frontend/core/part_times.h"
#include "frontend/core/statistics.h"
#include "frontend/energy/patch_energy.h"
#include "frontend/image/frame_offset.h"

namespace cohort {
namespace {

// Rounds the penalty at singular values of 0 [px]; what noise alone gives each is larger. Chosen by
// eye on the tuning clips.
constexpr double kSmoothingPx = 0.15;

// Where the typical feature has come to rest [px of the level]; finer levels go on from the coarse.
constexpr double kRestPx = 0.01;
constexpr double kCoarseRestPx = 0.03;

std::vector<const float*> PatchesOf(std::span<const Feature> features, int level) {
  std::vector<const float*> patches;
  for (const Feature& feature : features) {
    patches.push_back(feature.templates[static_cast<std::size_t>(level)].data());
  }
  return patches;
}

Penalty PenaltyOf(const SubspaceOptions& options, std::size_t features, double scale) {
  Penalty penalty;
  penalty.kind = options.penalty;
  penalty.epsilon = options.epsilon;
  penalty.rank = options.uncentered ? 4 : 3;
  penalty.smoothing = static_cast<double>(features) * std::pow(kSmoothingPx * scale, 2);
  return penalty;
}

}  // namespace

double Contrast(const cv::Mat& picture,
                const Eigen::Matrix2Xd& x,
                std::span<const Feature> features,
                int n) {
  constexpr double kDistancePx = 1.5;
  constexpr Eigen::Index kEnough = 100;  // for a median
  std::vector<double> rises;
  for (Eigen::Index f = 0; f < x.cols(); f += 1 + x.cols() / kEnough) {
    const Feature& feature = features[static_cast<std::size_t>(f)];
    if (!feature.confirmed) continue;
    const auto& patch = feature.templates.front();
    double sum = 0.0;
    for (const auto& direction : {Eigen::Vector2d(1, 0),
                                  Eigen::Vector2d(-1, 0),
                                  Eigen::Vector2d(0, 1),
                                  Eigen::Vector2d(0, -1)}) {
      sum += PatchEnergy(picture, x.col(f) + kDistancePx * direction, patch, n);
    }
    rises.push_back((sum / 4 - PatchEnergy(picture, x.col(f), patch, n)) / kDistancePx);
  }
  return Median(std::move(rises));
}

std::optional<double> DataWeight(const SubspaceOptions& options,
                                 double contrast,
                                 Eigen::Index features) {
  const double m = options.penalty_weight * CalibratedWeight(options.penalty, options.constraint);
  if (!(m > 0.0 && contrast > 0.0)) return std::nullopt;
  const double weight = 1.0 / (m * contrast);
  return options.constraint == Constraint::kStrong ? weight / static_cast<double>(features)
                                                   : weight;
}

LevelEnergy::LevelEnergy(const Pyramid& current,
                         int level,
                         std::span<const Feature> features,
                         const GuidePast& past,
                         const SubspaceOptions& options)
    : options_(options),
      rest_px_(level == 0 ? kRestPx : kCoarseRestPx),
      patches_(PatchesOf(features, level)),
      trajectories_(past.history
                        ? std::optional<TrajectoryMatrix>(std::in_place,
                                                          std::ldexp(1.0, -level) * *past.history,
                                                          !options.uncentered)
                        : std::nullopt),
      penalty_(PenaltyOf(options, features.size(), std::ldexp(1.0, -level))),
      energy_(current.levels[static_cast<std::size_t>(level)],
              patches_,
              options.template_px,
              past.data_weights,
              past.history ? &*trajectories_ : nullptr,
              past.history ? &penalty_ : nullptr) {}

OptimizerResult LevelEnergy::Minimize(const Eigen::Matrix2Xd& x) const {
  const SubspaceOptions& o = options_;
  if (!trajectories_) return MinimizeSeparately(energy_, x, o.max_iterations);
  return o.optimizer == OptimizerKind::kAlgorithm1
             ? MinimizeAlgorithm1(energy_, x, o.min_iterations, o.max_iterations)
             : MinimizeJointly(energy_, x, penalty_.rank, o.max_iterations, rest_px_);
}

void JointGuide::Begin(const Pyramid& picture) {
  history_.clear();
  history_.emplace_front(2, 0);
  previous_ = picture;
  contrast_ = 0.0;
}

void JointGuide::Add(std::span<const std::vector<Eigen::Vector2d>> births,
                     const Pyramid& picture,
                     std::span<const Feature> features) {
  for (std::size_t l = 0; l < history_.size(); ++l) {
    Eigen::Matrix2Xd& x = history_[l];
    const Eigen::Index old = x.cols();
    x.conservativeResize(2, old + static_cast<Eigen::Index>(births.size()));
    for (std::size_t i = 0; i < births.size(); ++i) {
      x.col(old + static_cast<Eigen::Index>(i)) = births[i][l];
    }
  }
  if (contrast_ == 0.0) {
    contrast_ = Contrast(picture.levels[0], history_.front(), features, options_.template_px);
  }
}

void JointGuide::Keep(std::span<const std::uint8_t> keep) {
  for (Eigen::Matrix2Xd& x : history_) {
    Eigen::Index kept = 0;
    for (std::size_t f = 0; f < keep.size(); ++f) {
      if (keep[f] != 0) x.col(kept++) = x.col(static_cast<Eigen::Index>(f));
    }
    x.conservativeResize(2, kept);
  }
}

Eigen::Matrix2Xd JointGuide::Start(const Pyramid& current) const {
  return history_.front().colwise() + RegisterFrames(previous_, current);
}

OptimizerResult JointGuide::Minimize(const Pyramid& current,
                                     std::span<const Feature> features,
                                     const Eigen::Matrix2Xd& start) const {
  const TimedPart part("guide");
  const GuidePast past = Past(features);
  OptimizerResult all;
  all.x = start;
  for (int level = static_cast<int>(current.levels.size()) - 1; level >= 0; --level) {
    const double scale = std::ldexp(1.0, -level);
    const LevelEnergy energy(current, level, features, past, options_);
    const OptimizerResult one = energy.Minimize(scale * all.x);
    all.x = one.x / scale;
    all.energy = one.energy;
    all.iterations += one.iterations;
    all.evaluations += one.evaluations;
  }
  return all;
}

GuidePast JointGuide::Past(std::span<const Feature> features) const {
  const auto F = static_cast<Eigen::Index>(features.size());
  GuidePast past{std::nullopt, Eigen::VectorXd::Ones(F)};
  const std::optional<double> share = DataWeight(options_, contrast_, F);
  if (!share) return past;
  past.history.emplace(2 * static_cast<Eigen::Index>(history_.size()), F);
  for (std::size_t l = 0; l < history_.size(); ++l) {
    past.history->middleRows(2 * static_cast<Eigen::Index>(l), 2) = history_[l];
  }
  for (Eigen::Index f = 0; f < F; ++f) {
    past.data_weights[f] = features[static_cast<std::size_t>(f)].confirmed ? *share : 0.0;
  }
  return past;
}

void JointGuide::Remember(const Pyramid& current,
                          Eigen::Matrix2Xd x,
                          std::span<const Feature> features) {
  const TimedPart part("guide");
  const double contrast = Contrast(current.levels[0], x, features, options_.template_px);
  if (contrast > 0.0) contrast_ = 0.8 * contrast_ + 0.2 * contrast;
  history_.push_front(std::move(x));
  if (history_.size() > static_cast<std::size_t>(options_.history_length)) history_.pop_back();
  previous_ = current;
}

}  // namespace cohort
