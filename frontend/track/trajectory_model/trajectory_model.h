#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "frontend/track/trajectory_model/joint_fit.h"
#include "frontend/track/trajectory_model/observation.h"
#include "frontend/track/trajectory_model/prediction.h"
#include "frontend/track/trajectory_model/state.h"

namespace cohort {

// All trajectories as one probabilistic low-rank model (paper section 2: those of a rigid scene lie
// near a subspace of low dimension; here with perspective, noise, missing frames and uncertainty).
// In frame l feature f is measured at
//   y_lf = (m_l + B_l z_f) / (1 + c_l' z_f) + e_f + noise_lf,   z_f ~ N(0, I_r),
// with m_l, B_l, c_l (2 x 1, 2 x r, r x 1) the frame's camera, z_f the feature's coordinates and
// e_f the error of its anchor. r = 3 gives a projective reconstruction, c = 0 the paper's subspace.
//
// The model is fitted to a sliding window of frames: first a new frame's camera (camera_fit.h),
// then the newest cameras and all features together (joint_fit.h), a quarter of the older cameras
// per frame one by one, and each feature by itself (feature_fit.h). The rank r grows where the
// residuals require it (rank.h). The time per frame is linear in the features; loops over them use
// fixed sizes where possible (sized.h).
class TrajectoryModel {
 public:
  using Observation = trajectory_model::Observation;
  using Estimate = trajectory_model::Estimate;

  // Without perspective c = 0.
  TrajectoryModel(std::size_t max_frames, int max_rank, bool perspective)
      : max_frames_(max_frames), max_rank_(max_rank) {
    state_.perspective = perspective;
  }

  std::size_t frames() const { return state_.frames.size(); }
  int rank() const { return state_.rank; }

  // Predicts all features in a new frame, from their own earlier measurements and from the current
  // measurements of those that `now` observes. Returns an empty list if these are fewer than eight.
  std::vector<Estimate> Predict(std::span<const Observation> now) const;
  // Adds the frame; the estimates then include the features' own measurements in it.
  std::vector<Estimate> Update(std::span<const Observation> now);

  // The factor by which a feature's residuals exceed what their noise explains (MisfitOfFeature).
  double Misfit(std::size_t feature) const;

  // Drops the features whose entry is 0; the others keep their order.
  void Keep(std::span<const std::uint8_t> keep);
  // Adds a feature that was born at `xy` in the newest frame.
  void Add(const Eigen::Vector2d& xy);

 private:
  bool CanFit(std::span<const Observation> now) const;

  std::size_t max_frames_;
  int max_rank_;
  trajectory_model::State state_;
  trajectory_model::JointFit joint_fit_;
  std::size_t turn_ = 0;  // for the steps that do not run in every frame
};

}  // namespace cohort
