#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "frontend/energy/total_energy.h"
#include "frontend/image/pyramid.h"
#include "frontend/track/optimizer.h"
#include "frontend/track/tracker_options.h"

namespace cohort {

// Templates of a feature, n x n on each level of a pyramid.
using Templates = std::vector<std::vector<float>>;
Templates TakeTemplates(const Pyramid& pyramid, const Eigen::Vector2d& xy, int n);

// How steeply the energy rises around features, so that one penalty weight m fits bright and dark
// pictures: the data term's slope grows with the contrast, the penalty's does not. Median over
// features of the mean rise at 1.5 px [1/px]; 0 without features.
double Contrast(const cv::Mat& picture,
                const Eigen::Matrix2Xd& x,
                std::span<const Templates* const> templates,
                int n);

// The weight of every feature's data term, paper equation (7): 1 / (m F contrast), or 1 / (m
// contrast) with a weak constraint. None without a penalty: m or the contrast is 0.
std::optional<double> DataWeight(const SubspaceOptions& options,
                                 double contrast,
                                 Eigen::Index features);

// What the guide minimises on one level of the pyramid, and how. Positions are those of the level.
class GuideEnergy {
 public:
  // `history`: 2 L x F at full resolution, newest first. Without penalty every feature is for
  // itself. `current` and `templates` must outlive this.
  GuideEnergy(const Pyramid& current,
              int level,
              std::span<const Templates* const> templates,
              const Eigen::MatrixXd& history,
              const Eigen::VectorXd& weights,
              bool penalized,
              const SubspaceOptions& options);
  GuideEnergy(const GuideEnergy&) = delete;
  GuideEnergy& operator=(const GuideEnergy&) = delete;

  const TotalEnergy& total() const { return energy_; }
  OptimizerResult Minimize(const Eigen::Matrix2Xd& x) const;

 private:
  SubspaceOptions options_;
  std::vector<const float*> patches_;
  std::optional<TrajectoryMatrix> trajectories_;
  Penalty penalty_;
  TotalEnergy energy_;
};

}  // namespace cohort
