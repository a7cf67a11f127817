#pragma once

#include "frontend/core/options.h"
#include "frontend/energy/penalty.h"
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
    case PenaltyKind::kNone:
      return 0.0;
    case PenaltyKind::kEmpiricalDimension:
      break;
  }
  return strong ? 1.0 : 40.0;
}

// The paper's joint tracker. Its first-order single-feature tracker (`descent`) shares the template
// size.
struct SubspaceOptions {
  Constraint constraint = Constraint::kStrong;
  PenaltyKind penalty = PenaltyKind::kNone;
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
        "How strongly the features constrain each other. Strong requires a mostly rigid scene; "
        "weak gives their joint motion no more weight than a single feature's patch has.",
        Tier::kCommon);
    v.Choice("penalty",
             o.penalty,
             kPenaltyNames,
             "What guides the features. none: Lucas-Kanade guides each of them alone; otherwise "
             "the paper's total energy guides all of them together, with this measure of the "
             "dimension of their joint motion, equations (4) to (6) of the paper.",
             Tier::kCommon);
    v.Flag("uncentered",
           o.uncentered,
           "Do not subtract the features' mean motion before its dimension is measured: that of a"
           " rigid scene is then 4 instead of 3.",
           Tier::kCommon);
    v.Number("history_length",
             o.history_length,
             1,
             60,
             "The number of past frames over which the features constrain each other, the L of "
             "the paper. More frames distinguish motion from noise better, but take more time.",
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
             "max_i of Algorithm 1, or the maximum number of Newton steps, on each level of the "
             "pyramid");
  }
};

// The tracker of the paper's section 4, to be run with the measurement off. The paper does not
// state m (its supplement does), the template side of its timing and the iteration limits; these
// values are ours.
inline SubspaceOptions PaperSubspaceOptions() {
  SubspaceOptions options;
  options.penalty = PenaltyKind::kEmpiricalDimension;
  options.constraint = Constraint::kWeak;
  options.template_px = 7;
  options.optimizer = OptimizerKind::kAlgorithm1;
  return options;
}

}  // namespace cohort
