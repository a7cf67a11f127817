#pragma once

#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

// The newest cameras and all features together, by Levenberg-Marquardt: where the camera moves
// ahead, fitting one and the other in turn needs hundreds of steps.
//
// Every feature f is eliminated (Schur complement). With N the normal matrix, g the gradients, C
// the cameras: (N_CC - sum_f N_Cf N_ff^-1 N_fC) dC = g_C - sum_f N_Cf N_ff^-1 g_f, and then
// dx_f = N_ff^-1 (g_f - N_fC dC). The diagonal of the left side times 1 + damping.
class JointFit {
 public:
  static constexpr std::size_t kMostFrames = 12;
  // So many of the newest frames' cameras move, older ones are left to RefitCamera: all of a short
  // window, of a long one few, as the time grows with the square of it.
  static std::size_t FramesOf(const State& state) {
    constexpr std::size_t kFrames = 6;
    return state.frames.size() <= kMostFrames ? state.frames.size() : kFrames;
  }

  // One step that does not raise the cost. None where five dampings find none.
  void Step(State& state);

 private:
  static constexpr double kFirstDamping = 1e-3;
  double damping_ = kFirstDamping;  // goes on from the last step
};

}  // namespace cohort::trajectory_model
