#pragma once

#include <Eigen/Core>
#include <cstddef>

#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

// The normal equations of one feature's unknowns x = (z, e) at its mean, for given cameras. In
// frame l the residual d_l = y_l - xy_l - e has the derivative -J_l, J_l = [d xy / d z, I] (no I in
// the frame of the anchor), and the weight W_l. With the priors z ~ N(0, I), e ~ N(0, A^-1):
//   information = sum_l J_l' W_l J_l + diag(I, A),   gradient = sum_l J_l' W_l d_l - diag(I, A) x.
// A, the anchor's information, is the mean of the feature's measurements': an anchor is as noisy as
// any picture.
struct FeatureEquations {
  Matrix information;
  Vector gradient;
  Eigen::Matrix2d anchor_information = Eigen::Matrix2d::Zero();
};

enum class Noise {
  kGaussian,  // every measurement has its stated covariance
  kStudent,   // RobustInformation
};

FeatureEquations EquationsOfFeature(const State& state, std::size_t f, Noise noise);

// The equations together with CostOfFeature, in one pass.
struct FeatureEquationsAndCost {
  FeatureEquations equations;
  double cost = 0.0;
};
FeatureEquationsAndCost EquationsAndCostOfFeature(const State& state, std::size_t f, Noise noise);

// Twice the negative logarithm of the posterior of x, up to a constant. A step must lower it.
double CostOfFeature(const State& state,
                     std::size_t f,
                     const Eigen::Matrix2d& anchor_information,
                     Noise noise);

// The covariance of a feature's unknowns.
Matrix InverseOf(const Matrix& information);

// The posterior N(x, information^-1), by one Gauss-Newton step from the previous estimate, or by
// eight from zero for a new feature. A step is halved until the cost does not rise: a full step
// across a camera's plane at infinity (1 + c'z = 0) is arbitrary.
void FitFeature(State& state, std::size_t f);
void FitAllFeatures(State& state);

}  // namespace cohort::trajectory_model
