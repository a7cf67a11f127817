#pragma once

#include <Eigen/Core>
#include <span>

#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

struct CameraFit {
  Camera camera;
  Eigen::MatrixXd covariance;  // of vec(camera), column by column
};

// Fits the camera of a new frame to given features, by Gauss-Newton steps of generalised least
// squares. Residuals d_f have the covariance S_f = noise_f + J_f cov(z_f, e_f) J_f' (a feature with
// uncertain coordinates has little weight) and Student's t weights. The prior is the newest frame's
// camera; its variances are the mean squared steps of the entries from frame to frame. What the
// observed features do not determine thus continues its earlier motion.
CameraFit FitNewCamera(const State& state, std::span<const Observation> now);

// Refits the camera of a frame in the window by one step of expectation maximisation. The normal
// equations of vec(C) are taken in expectation over the features' posteriors, where [1 z][1 z]' has
// the mean [1 z][1 z]' + diag(0, cov z), and (z - mean) correlates with the residual.
void RefitCamera(const State& state, Frame& frame);

}  // namespace cohort::trajectory_model
