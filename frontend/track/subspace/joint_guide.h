#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "frontend/core/options.h"
#include "frontend/energy/penalty.h"
#include "frontend/energy/total_energy.h"
#include "frontend/image/pyramid.h"
#include "frontend/track/measure/feature.h"
#include "frontend/track/subspace/optimizer.h"

namespace cohort {

// How strongly the penalty constrains the features, paper equation (7).
enum class Constraint {
  kStrong,  // alpha = 1 / (m F n^2): the scene is rigid; a few features cannot overrule it
  kWeak,    // alpha = 1 / (m n^2): the weight of a single feature
};
inline constexpr ChoiceNames<Constraint, 2> kConstraintNames{
    {{"strong", Constraint::kStrong}, {"weak", Constraint::kWeak}}};

// m of eq. (7) relative to the picture's contrast: the value that brings the guide's worst darkness
// level nearest to the best result of that level (docs/results/paper.md).
inline double CalibratedWeight(PenaltyKind penalty, Constraint constraint) {
  const bool strong = constraint == Constraint::kStrong;
  switch (penalty) {
    case PenaltyKind::kExplicitFactorization:
      return strong ? 0.02 : 0.8;
    case PenaltyKind::kNuclearNorm:
      return strong ? 0.0084 : 0.34;
    case PenaltyKind::kEmpiricalDimension:
      break;
  }
  return strong ? 1.0 : 40.0;
}

// The paper's joint tracker. Its first-order single-feature tracker (`descent`) shares the template
// size.
struct SubspaceOptions {
  Constraint constraint = Constraint::kStrong;
  PenaltyKind penalty = PenaltyKind::kEmpiricalDimension;
  bool uncentered = false;
  int history_length = 10;
  int template_px = 11;
  double penalty_weight = 1.0;
  double epsilon = 0.6;
  OptimizerKind optimizer = OptimizerKind::kJointNewton;
  int min_iterations = 4;
  int max_iterations = 20;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice(
        "constraint",
        o.constraint,
        kConstraintNames,
        "How hard the features hold each other. Strong needs a scene that is mostly rigid; weak "
        "gives their joint motion no more say than a single feature's patch has.",
        Tier::kCommon);
    v.Choice("penalty",
             o.penalty,
             kPenaltyNames,
             "What measures the dimension of the joint motion, equations (4) to (6) of the "
             "paper; it is small where the scene is rigid.",
             Tier::kCommon);
    v.Flag("uncentered",
           o.uncentered,
           "Leave the features' mean motion in before its dimension is measured: that of a"
           " rigid scene is then 4, not 3.",
           Tier::kCommon);
    v.Number("history_length",
             o.history_length,
             1,
             60,
             "How many past frames the features hold each other over, the L of the paper. "
             "More frames tell true motion from noise better; the time grows.",
             Tier::kCommon);
    v.Odd("template_px", o.template_px, 3, 63, "n of the paper: side of the template [px]");
    v.Number("penalty_weight",
             o.penalty_weight,
             0.0,
             1e9,
             "m of equation (7), as a multiple of the calibrated one");
    v.Number("epsilon", o.epsilon, 0.01, 1.0, "epsilon of the empirical dimension, equation (6)");
    v.Choice("optimizer", o.optimizer, kOptimizerNames, "how the total energy is minimised");
    v.Number("min_iterations",
             o.min_iterations,
             1,
             1000,
             "min_i of Algorithm 1, on each level of the pyramid");
    v.Number("max_iterations",
             o.max_iterations,
             1,
             1000,
             "max_i of Algorithm 1 and most Newton steps, on each level of the pyramid");
  }
};

// The tracker of the paper's section 4, to be run with the measurement off. The paper does not
// state m (its supplement does), the template side of its timing and the iteration limits; these
// values are ours.
inline SubspaceOptions PaperSubspaceOptions() {
  SubspaceOptions options;
  options.constraint = Constraint::kWeak;
  options.template_px = 7;
  options.optimizer = OptimizerKind::kAlgorithm1;
  return options;
}

// The median over confirmed features of the energy's mean rise at 1.5 px [1/px]; 0 without
// features. It makes one penalty weight m fit bright and dark pictures: the slope of the data term
// grows with the contrast, that of the penalty does not. `n`: side of the templates.
double Contrast(const cv::Mat& picture,
                const Eigen::Matrix2Xd& x,
                std::span<const Feature> features,
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
  // `current` and `features` must outlive this.
  LevelEnergy(const Pyramid& current,
              int level,
              std::span<const Feature> features,
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
// frames (TrajectoryMatrix) near a subspace of low dimension.
//
//   guide.Begin(picture); guide.Add(births, picture, features);
//   for each frame: x = guide.Minimize(picture, features, guide.Start(picture)).x;
//                   guide.Remember(picture, x, features);   // with `confirmed` of this frame
class JointGuide {
 public:
  // With penalty_weight 0 the features are independent (equation 2).
  explicit JointGuide(const SubspaceOptions& options) : options_(options) {}

  const History& history() const { return history_; }

  // Removes all features; the window starts with this picture.
  void Begin(const Pyramid& picture);
  // Appends new features: the positions of each in the frames of the history, newest first.
  // `features` are all features, `picture` is the newest.
  void Add(std::span<const std::vector<Eigen::Vector2d>> births,
           const Pyramid& picture,
           std::span<const Feature> features);
  void Keep(std::span<const std::uint8_t> keep);

  // The newest positions, moved with the whole picture.
  Eigen::Matrix2Xd Start(const Pyramid& current) const;
  // The nearest minimum, from coarse to fine. A feature that the last frame did not confirm has no
  // data term (a_f = 0): the others lead it until the image confirms it again.
  OptimizerResult Minimize(const Pyramid& current,
                           std::span<const Feature> features,
                           const Eigen::Matrix2Xd& start) const;
  LevelEnergy Energy(const Pyramid& current, int level, std::span<const Feature> features) const {
    return {current, level, features, Past(features), options_};
  }

  // Adds `x` to the history.
  void Remember(const Pyramid& current, Eigen::Matrix2Xd x, std::span<const Feature> features);

 private:
  GuidePast Past(std::span<const Feature> features) const;

  SubspaceOptions options_;
  History history_;  // at most L
  Pyramid previous_;
  double contrast_ = 0.0;  // running mean
};

}  // namespace cohort
