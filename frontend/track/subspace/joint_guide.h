#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "frontend/energy/penalty.h"
#include "frontend/energy/total_energy.h"
#include "frontend/image/pyramid.h"
#include "frontend/track/subspace/guide.h"
#include "frontend/track/subspace/optimizer.h"
#include "frontend/track/subspace/subspace_options.h"

namespace cohort {

// The appearance of a feature at its birth, n x n row by row on each level of a pyramid: T of the
// single-feature energy, paper equation (1).
using Templates = std::vector<std::vector<float>>;
Templates TakeTemplates(const Pyramid& pyramid, const Eigen::Vector2d& xy, int n);

// The median over confirmed features of the energy's mean rise at 1.5 px [1/px]; 0 without
// features. It makes one penalty weight m fit bright and dark pictures: the slope of the data term
// grows with the contrast, that of the penalty does not. `n`: side of the templates.
double Contrast(const cv::Mat& picture,
                const Eigen::Matrix2Xd& x,
                std::span<const Templates> templates,
                std::span<const std::uint8_t> confirmed,
                int n);

// The weight of every feature's data term, paper equation (7): 1 / (m F contrast), or 1 / (m
// contrast) with a weak constraint. Returns nullopt if m or the contrast is 0, that is, without a
// penalty.
std::optional<double> DataWeight(const SubspaceOptions& options,
                                 double contrast,
                                 Eigen::Index features);

// What the levels of one frame's pyramid share.
struct GuidePast {
  std::optional<Eigen::MatrixXd> history;  // 2 L x F [px], newest first; unset: no penalty
  Eigen::VectorXd data_weights;            // a_f, F
};

// The total energy on one level of the pyramid, with all that it refers to and its optimizer.
// Positions are those of the level.
class LevelEnergy {
 public:
  // `current` and `templates` must outlive this.
  LevelEnergy(const Pyramid& current,
              int level,
              std::span<const Templates> templates,
              const GuidePast& past,
              const SubspaceOptions& options);
  LevelEnergy(const LevelEnergy&) = delete;
  LevelEnergy& operator=(const LevelEnergy&) = delete;

  const TotalEnergy& total() const { return energy_; }
  OptimizerResult Minimize(const Eigen::Matrix2Xd& x) const;

 private:
  SubspaceOptions options_;
  double rest_px_;
  std::vector<const float*> patches_;
  std::optional<TrajectoryMatrix> trajectories_;
  Penalty penalty_;
  TotalEnergy energy_;
};

// The positions of all features in the newest frames, newest first: 2 x F each [px].
using History = std::deque<Eigen::Matrix2Xd>;

// The paper's tracker (3.1 to 3.3): all features move together to the minimum of the total energy,
//   C(x) = sum_f a_f c_f(x_f) + P(M(x)),                        equation (3): TotalEnergy
// over a pyramid. The penalty P (equations 4 to 6: Penalty) keeps the trajectories M of the last L
// frames (TrajectoryMatrix) near a subspace of low dimension. A new feature's column of M is filled
// backwards by the motion of the features around it.
class JointGuide final : public Guide {
 public:
  // Without a penalty, or with penalty_weight 0, the features are independent (equation 2).
  explicit JointGuide(const SubspaceOptions& options) : options_(options) {}

  const History& history() const { return history_; }
  const std::vector<Templates>& templates() const { return templates_; }

  void Begin(const Pyramid& picture) override;
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& picture) override;
  void Keep(std::span<const std::uint8_t> keep) override;
  const Eigen::Matrix2Xd& positions() const override { return history_.front(); }
  Eigen::Matrix2Xd Find(const Pyramid& current,
                        std::span<const std::uint8_t> confirmed) const override {
    return Minimize(current, confirmed, Start(current)).x;
  }
  void Remember(const Pyramid& current,
                const Eigen::Matrix2Xd& x,
                std::span<const std::uint8_t> confirmed) override;

  // The newest positions, moved with the whole picture.
  Eigen::Matrix2Xd Start(const Pyramid& current) const;
  // The nearest minimum, from coarse to fine. A feature that the last frame did not confirm has no
  // data term (a_f = 0): the others lead it until the image confirms it again.
  OptimizerResult Minimize(const Pyramid& current,
                           std::span<const std::uint8_t> confirmed,
                           const Eigen::Matrix2Xd& start) const;
  LevelEnergy Energy(const Pyramid& current,
                     int level,
                     std::span<const std::uint8_t> confirmed) const {
    return {current, level, templates_, Past(confirmed), options_};
  }

 private:
  GuidePast Past(std::span<const std::uint8_t> confirmed) const;

  SubspaceOptions options_;
  std::vector<Templates> templates_;
  History history_;  // at most L
  Pyramid previous_;
  double contrast_ = 0.0;  // running mean
};

}  // namespace cohort
