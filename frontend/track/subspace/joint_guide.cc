#include "frontend/track/subspace/joint_guide.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "frontend/core/keep.h"
#include "frontend/core/part_times.h"
#include "frontend/core/statistics.h"
#include "frontend/energy/patch_energy.h"
#include "frontend/image/frame_offset.h"
#include "frontend/image/sampling.h"

namespace cohort {
namespace {

// Rounds the penalty at singular values of 0 [px]; what noise alone gives each is larger. Chosen by
// eye on the tuning clips.
constexpr double kSmoothingPx = 0.15;

// Where the typical feature has come to rest [px of the level]; finer levels go on from the coarse.
constexpr double kRestPx = 0.01;
constexpr double kCoarseRestPx = 0.03;

std::vector<const float*> PatchesOf(std::span<const Templates> templates, int level) {
  std::vector<const float*> patches;
  for (const Templates& of_feature : templates) {
    patches.push_back(of_feature[static_cast<std::size_t>(level)].data());
  }
  return patches;
}

// The old features nearest to a position, of equal ones the older first, and their weights, which
// are about the same within kReachPx.
struct Neighbours {
  std::vector<Eigen::Index> features;
  std::vector<double> weights;  // their sum is 1
};

Neighbours Nearest(const Eigen::Matrix2Xd& others, const Eigen::Vector2d& xy) {
  constexpr Eigen::Index kNeighbours = 8;
  constexpr double kReachPx = 10.0;
  Neighbours near;
  near.features.resize(static_cast<std::size_t>(others.cols()));
  std::iota(near.features.begin(), near.features.end(), Eigen::Index{0});
  const auto distance = [&](Eigen::Index g) { return (others.col(g) - xy).squaredNorm(); };
  const auto count = static_cast<std::size_t>(std::min(kNeighbours, others.cols()));
  std::partial_sort(near.features.begin(),
                    near.features.begin() + static_cast<std::ptrdiff_t>(count),
                    near.features.end(),
                    [&](Eigen::Index a, Eigen::Index b) {
                      return std::pair(distance(a), a) < std::pair(distance(b), b);
                    });
  near.features.resize(count);
  double sum = 0.0;
  for (const Eigen::Index g : near.features) {
    near.weights.push_back(1.0 / (kReachPx * kReachPx + distance(g)));
    sum += near.weights.back();
  }
  for (double& weight : near.weights) weight /= sum;
  return near;
}

// How the neighbours moved between two frames; nothing moves where there are none.
Eigen::Vector2d MotionOf(const Neighbours& near,
                         const Eigen::Matrix2Xd& from,
                         const Eigen::Matrix2Xd& to) {
  Eigen::Vector2d motion = Eigen::Vector2d::Zero();
  for (std::size_t k = 0; k < near.features.size(); ++k) {
    const Eigen::Index g = near.features[k];
    motion += near.weights[k] * (to.col(g) - from.col(g));
  }
  return motion;
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

Templates TakeTemplates(const Pyramid& pyramid, const Eigen::Vector2d& xy, int n) {
  Templates templates;
  double scale = 1.0;
  for (const cv::Mat& level : pyramid.levels) {
    std::vector<float> patch(static_cast<std::size_t>(n) * n);
    SamplePatch(level, xy.x() * scale, xy.y() * scale, n, patch.data());
    templates.push_back(std::move(patch));
    scale *= 0.5;
  }
  return templates;
}

double Contrast(const cv::Mat& picture,
                const Eigen::Matrix2Xd& x,
                std::span<const Templates> templates,
                std::span<const std::uint8_t> confirmed,
                int n) {
  constexpr double kDistancePx = 1.5;
  constexpr Eigen::Index kEnough = 100;  // for a median
  std::vector<double> rises;
  for (Eigen::Index f = 0; f < x.cols(); f += 1 + x.cols() / kEnough) {
    if (confirmed[static_cast<std::size_t>(f)] == 0) continue;
    const auto& patch = templates[static_cast<std::size_t>(f)].front();
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
                         std::span<const Templates> templates,
                         const GuidePast& past,
                         const SubspaceOptions& options)
    : options_(options),
      rest_px_(level == 0 ? kRestPx : kCoarseRestPx),
      patches_(PatchesOf(templates, level)),
      trajectories_(past.history
                        ? std::optional<TrajectoryMatrix>(std::in_place,
                                                          std::ldexp(1.0, -level) * *past.history,
                                                          !options.uncentered)
                        : std::nullopt),
      penalty_(PenaltyOf(options, templates.size(), std::ldexp(1.0, -level))),
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
  templates_.clear();
  history_.clear();
  history_.emplace_front(2, 0);
  previous_ = picture;
  contrast_ = 0.0;
}

void JointGuide::Add(std::span<const Eigen::Vector2d> born, const Pyramid& picture) {
  const TimedPart part("births");
  // Only the old features lead the new ones; their columns stay as they are.
  const Eigen::Matrix2Xd others = history_.front();
  const Eigen::Index old = others.cols();
  for (Eigen::Matrix2Xd& x : history_) {
    x.conservativeResize(2, old + static_cast<Eigen::Index>(born.size()));
  }
  for (std::size_t i = 0; i < born.size(); ++i) {
    templates_.push_back(TakeTemplates(picture, born[i], options_.template_px));
    const Neighbours near = Nearest(others, born[i]);
    const Eigen::Index f = old + static_cast<Eigen::Index>(i);
    history_.front().col(f) = born[i];
    for (std::size_t l = 1; l < history_.size(); ++l) {
      history_[l].col(f) = history_[l - 1].col(f) + MotionOf(near, history_[l - 1], history_[l]);
    }
  }
  if (contrast_ == 0.0) {
    const std::vector<std::uint8_t> all(templates_.size(), 1);
    contrast_ =
        Contrast(picture.levels[0], history_.front(), templates_, all, options_.template_px);
  }
}

void JointGuide::Keep(std::span<const std::uint8_t> keep) {
  for (Eigen::Matrix2Xd& x : history_) KeepOnly(keep, x);
  KeepOnly(keep, templates_);
}

Eigen::Matrix2Xd JointGuide::Start(const Pyramid& current) const {
  return history_.front().colwise() + RegisterFrames(previous_, current);
}

OptimizerResult JointGuide::Minimize(const Pyramid& current,
                                     std::span<const std::uint8_t> confirmed,
                                     const Eigen::Matrix2Xd& start) const {
  const TimedPart part("guide");
  const GuidePast past = Past(confirmed);
  OptimizerResult all;
  all.x = start;
  for (int level = static_cast<int>(current.levels.size()) - 1; level >= 0; --level) {
    const double scale = std::ldexp(1.0, -level);
    const LevelEnergy energy(current, level, templates_, past, options_);
    const OptimizerResult one = energy.Minimize(scale * all.x);
    all.x = one.x / scale;
    all.energy = one.energy;
    all.iterations += one.iterations;
    all.evaluations += one.evaluations;
  }
  return all;
}

GuidePast JointGuide::Past(std::span<const std::uint8_t> confirmed) const {
  const auto F = static_cast<Eigen::Index>(templates_.size());
  GuidePast past{std::nullopt, Eigen::VectorXd::Ones(F)};
  const std::optional<double> share = DataWeight(options_, contrast_, F);
  if (!share) return past;
  past.history.emplace(2 * static_cast<Eigen::Index>(history_.size()), F);
  for (std::size_t l = 0; l < history_.size(); ++l) {
    past.history->middleRows(2 * static_cast<Eigen::Index>(l), 2) = history_[l];
  }
  for (Eigen::Index f = 0; f < F; ++f) {
    past.data_weights[f] = confirmed[static_cast<std::size_t>(f)] != 0 ? *share : 0.0;
  }
  return past;
}

void JointGuide::Remember(const Pyramid& current,
                          const Eigen::Matrix2Xd& x,
                          std::span<const std::uint8_t> confirmed) {
  const TimedPart part("guide");
  const double contrast =
      Contrast(current.levels[0], x, templates_, confirmed, options_.template_px);
  if (contrast > 0.0) contrast_ = 0.8 * contrast_ + 0.2 * contrast;
  history_.push_front(x);
  if (history_.size() > static_cast<std::size_t>(options_.history_length)) history_.pop_back();
  previous_ = current;
}

}  // namespace cohort
