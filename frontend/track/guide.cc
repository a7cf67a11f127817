#include "frontend/track/guide.h"

#include <cmath>
#include <utility>

#include "frontend/core/statistics.h"
#include "frontend/energy/patch_energy.h"
#include "frontend/image/sampling.h"

namespace cohort {
namespace {

std::vector<const float*> PatchesOf(std::span<const Templates* const> templates, int level) {
  std::vector<const float*> patches;
  for (const Templates* feature : templates) {
    patches.push_back((*feature)[static_cast<std::size_t>(level)].data());
  }
  return patches;
}

Penalty PenaltyOf(const SubspaceOptions& options, std::size_t features, double scale) {
  Penalty penalty;
  penalty.kind = options.penalty;
  penalty.epsilon = options.epsilon;
  penalty.rank = options.uncentered ? 4 : 3;
  penalty.smoothing = static_cast<double>(features) * std::pow(options.smoothing_px * scale, 2);
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
                std::span<const Templates* const> templates,
                int n) {
  constexpr double kDistancePx = 1.5;
  std::vector<double> rises;
  for (Eigen::Index f = 0; f < x.cols(); ++f) {
    const auto& patch = templates[static_cast<std::size_t>(f)]->front();
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

GuideEnergy::GuideEnergy(const Pyramid& current,
                         int level,
                         std::span<const Templates* const> templates,
                         const Eigen::MatrixXd& history,
                         const Eigen::VectorXd& weights,
                         bool penalized,
                         const SubspaceOptions& options)
    : options_(options),
      patches_(PatchesOf(templates, level)),
      trajectories_(penalized
                        ? std::optional<TrajectoryMatrix>(
                              std::in_place, std::ldexp(1.0, -level) * history, !options.uncentered)
                        : std::nullopt),
      penalty_(PenaltyOf(options, templates.size(), std::ldexp(1.0, -level))),
      energy_(current.levels[static_cast<std::size_t>(level)],
              patches_,
              options.template_px,
              weights,
              penalized ? &*trajectories_ : nullptr,
              penalized ? &penalty_ : nullptr) {}

OptimizerResult GuideEnergy::Minimize(const Eigen::Matrix2Xd& x) const {
  const SubspaceOptions& o = options_;
  if (!trajectories_) return MinimizeSeparately(energy_, x, o.max_iterations);
  return o.optimizer == OptimizerKind::kAlgorithm1
             ? MinimizeAlgorithm1(energy_, x, o.min_iterations, o.max_iterations)
             : MinimizeJointly(energy_, x, penalty_.rank, o.max_iterations);
}

}  // namespace cohort
