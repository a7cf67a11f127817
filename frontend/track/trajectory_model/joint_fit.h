#pragma once

#include "frontend/track/trajectory_model/state.h"

namespace cohort::trajectory_model {

// Fits the newest cameras and all features together by Levenberg-Marquardt. Where the camera moves
// ahead, alternating between both needs hundreds of steps.
//
// Every feature f is eliminated (Schur complement). With N the normal matrix, g the gradients, C
// the cameras: (N_CC - sum_f N_Cf N_ff^-1 N_fC) dC = g_C - sum_f N_Cf N_ff^-1 g_f, and then dx_f =
// N_ff^-1 (g_f - N_fC dC). The diagonal of the left side is multiplied by 1 + damping.
class JointFit {
 public:
  static constexpr std::size_t kMostFrames = 12;
  // The number of newest frames whose cameras this step moves; RefitCamera moves older ones. A
  // short window moves all, a long one only a few, because the time grows with the square.
  static std::size_t FramesOf(const State& state) {
    constexpr std::size_t kFrames = 6;
    return state.frames.size() <= kMostFrames ? state.frames.size() : kFrames;
  }

  // Takes one step that does not raise the cost, or none if five dampings fail.
  void Step(State& state);

 private:
  static constexpr double kFirstDamping = 1e-3;
  double damping_ = kFirstDamping;  // kept from the last step
};

}  // namespace cohort::trajectory_model
