#pragma once

#include <Eigen/Core>

#include "frontend/core/options.h"
#include "frontend/energy/total_energy.h"

namespace cohort {

enum class OptimizerKind {
  kAlgorithm1,   // the paper's first-order descent
  kJointNewton,  // damped Newton steps of all features together
};
inline constexpr ChoiceNames<OptimizerKind, 2> kOptimizerNames{
    {{"algorithm-1", OptimizerKind::kAlgorithm1}, {"joint-newton", OptimizerKind::kJointNewton}}};

struct OptimizerResult {
  Eigen::Matrix2Xd x;
  double energy = 0.0;
  int iterations = 0;
  int evaluations = 0;  // of the total energy
};

// One level of the paper's Algorithm 1: steps along c = (a + b) / 2 with a = -grad C and b its
// semi-normalised version (every feature's 2-vector scaled to length 1), each to the nearest
// minimum on the line. Stops after min_iterations once the gradient shrinks by less than 1 %.
OptimizerResult MinimizeAlgorithm1(const TotalEnergy& energy,
                                   Eigen::Matrix2Xd x,
                                   int min_iterations,
                                   int max_iterations);

// The same energy by damped Newton steps that move all features together. Each step minimises
//   sum_f [ g_f' s_f + s_f' J_f s_f / 2 ] + sum_f |s_f - A v_f|^2_K / 2
// over s (2 x F) and A (2 x r),
// with g the exact gradient of C, J_f the data term's re-weighted curvature, K = (U h+ U')_(0:2,
// 0:2) the penalty's, and v_f feature f's coordinates in the leading r directions of the history (r
// = rank, and 1 for centring). Motions A v are combinations of past motions. They cost the penalty
// next to nothing, and a descent with one common step length cannot follow that narrow valley.
// Eliminating s leaves 2r unknowns. Every step is checked on C itself. Stops when the median
// feature moves by less than `rest_px`.
OptimizerResult MinimizeJointly(const TotalEnergy& energy,
                                Eigen::Matrix2Xd x,
                                int rank,
                                int max_iterations,
                                double rest_px = 0.01);

// Gradient descent of every feature on its own energy c_f with its own line search (the paper's
// "1st-order descent" tracker).
OptimizerResult MinimizeSeparately(const TotalEnergy& energy,
                                   Eigen::Matrix2Xd x,
                                   int max_iterations);

}  // namespace cohort
