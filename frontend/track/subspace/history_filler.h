#pragma once

#include <Eigen/Core>
#include <deque>
#include <vector>

#include "frontend/image/pyramid.h"
#include "frontend/track/measure/covariance_calibration.h"
#include "frontend/track/measure/feature.h"
#include "frontend/track/subspace/joint_guide.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// The past of a new feature in the frames of the window, newest first.
struct FilledHistory {
  std::vector<Eigen::Vector2d> xy;                     // in every frame; the first is its birth
  std::vector<TrajectoryModel::Observation> measured;  // unobserved where unconfirmed
};

// Fills the history of a new feature, so that every column of the trajectory matrix is always
// complete. It goes backwards, frame by frame, by the motion of the features around it, and
// corrects this by aligning the feature's anchor with the stored frames of the window.
class HistoryFiller {
 public:
  explicit HistoryFiller(const PatchOptions& patch) : patch_(patch) {}

  // The window starts with this picture, denoised for measuring.
  void Begin(Pyramid picture);
  // Adds a newer picture; keeps at most `history_length`.
  void Remember(Pyramid picture, std::size_t history_length);
  const Pyramid& newest() const { return pictures_.front(); }

  // `xy`: where the feature was born, in the newest picture; `others`: the old features' positions.
  FilledHistory Fill(const Eigen::Vector2d& xy,
                     const AnchorPatch& anchor,
                     const History& others,
                     const CovarianceCalibration& calibration) const;

 private:
  PatchOptions patch_;
  std::deque<Pyramid> pictures_;  // newest first
};

}  // namespace cohort
