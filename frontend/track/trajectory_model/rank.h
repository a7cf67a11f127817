#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

inline constexpr int kRigidRank = 3;  // of a rigid scene under a moving camera

// Raises the rank from 0 to 2 once there are enough features. The coordinates are the first
// features' positions in the newest frame, and all cameras are that frame's.
void BeginWithPositions(State& state);

// A measurement's residual divided by its deviation. A further coordinate would add J g v to it: v
// is the feature's, g the camera's column for it, J = d xy / d (C [1 z]) divided by the same
// deviation.
struct WhitenedResidual {
  std::size_t frame = 0;
  std::size_t feature = 0;
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> J = Eigen::Matrix<double, 2, 3>::Zero();
};

// One more coordinate: v_f of every feature, and the matching column g_l of every camera.
struct Direction {
  Eigen::VectorXd v;
  Eigen::Matrix3Xd g;
  double explained = 0.0;  // of the residuals' sum of squares
};
// Solves residual_lf = J_lf g_l v_f by least squares. Alternates between g and v, starting from
// `v`, while a pass explains more (by 2 %). v is scaled to a mean square of 1.
Direction FitDirection(std::span<const WhitenedResidual> residuals,
                       std::size_t frames,
                       bool perspective,
                       Eigen::VectorXd v);

// The largest sum of squares that one direction explains in F x N pairs of white noise: the square
// of a random matrix's largest singular value, (sqrt F + sqrt(k N))^2, with k the free entries of g
// (Geman 1980).
double EdgeOfNoise(std::size_t features, std::size_t frames, bool perspective);

// Adds one coordinate if the residuals share a direction that is stronger than white noise would
// give. The model thus fits few features, a plane, a scene and several bodies. Beyond the three of
// a rigid scene the evidence must be twice as strong and come from features observed often, because
// an occluder resembles one more body.
void AdaptRank(State& state, int max_rank);

}  // namespace cohort::trajectory_model
