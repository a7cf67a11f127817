#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

inline constexpr int kRigidRank = 3;  // of a rigid scene under a moving camera

// From rank 0 to 2, once there are features enough: the coordinates are the first features'
// positions in the newest frame, and all cameras that of this frame.
void BeginWithPositions(State& state);

// A measurement's residual over its deviation, to which a further coordinate would add J g v:
// v the feature's, g the camera's column for it, J = d xy / d (C [1 z]) over the same deviation.
struct WhitenedResidual {
  std::size_t frame = 0;
  std::size_t feature = 0;
  Eigen::Vector2d residual = Eigen::Vector2d::Zero();
  Eigen::Matrix<double, 2, 3> J = Eigen::Matrix<double, 2, 3>::Zero();
};

// One more coordinate: v_f of every feature, and the column g_l of every camera that goes with it.
struct Direction {
  Eigen::VectorXd v;
  Eigen::Matrix3Xd g;
  double explained = 0.0;  // of the residuals' sum of squares
};
// residual_lf = J_lf g_l v_f in the sense of least squares, by alternating between g and v from
// `v` on, while that explains more (by 2 %). The scale of v is that of a mean square of 1.
Direction FitDirection(std::span<const WhitenedResidual> residuals,
                       std::size_t frames,
                       bool perspective,
                       Eigen::VectorXd v);

// The largest sum of squares that one direction explains in F x N pairs of white noise: the square
// of a random matrix's largest singular value, (sqrt F + sqrt(k N))^2, k the entries of g that are
// free (Geman 1980).
double EdgeOfNoise(std::size_t features, std::size_t frames, bool perspective);

// One more coordinate, where the residuals have a direction in common that is stronger than white
// noise would have; so the model fits few features, a plane, a scene and several bodies. Beyond the
// three of a rigid scene the evidence must be twice as strong, and of features observed often,
// since what comes to cover the scene looks like one more body too.
void AdaptRank(State& state, int max_rank);

}  // namespace cohort::trajectory_model
