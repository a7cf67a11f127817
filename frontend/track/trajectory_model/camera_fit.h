#pragma once

#include <Eigen/Core>
#include <span>

#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

struct CameraFit {
  Camera camera;
  Eigen::MatrixXd covariance;  // of vec(camera), its columns below each other
};

// The camera of a new frame, features given, by Gauss-Newton steps of generalised least squares:
// residuals d_f of the covariance S_f = noise_f + J_f cov(z_f, e_f) J_f' (a feature whose
// coordinates are uncertain has little say), weighted by Student's t. The prior is the newest
// frame's camera, with the mean squares of its entries' steps from frame to frame as variances:
// what the features observed do not tell moves as it did before.
CameraFit FitNewCamera(const State& state, std::span<const Observation> now);

// The camera of a frame in the window, one step of expectation maximisation: the normal equations
// of vec(C) in expectation over the features' posteriors, where [1 z][1 z]' has the mean
// [1 z][1 z]' + diag(0, cov z), and (z - mean) correlates with the residual.
void RefitCamera(const State& state, Frame& frame);

}  // namespace cohort::trajectory_model
