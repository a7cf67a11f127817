#pragma once

#include <Eigen/Core>

#include "frontend/track/confirmation.h"
#include "frontend/track/feature.h"
#include "frontend/track/feature_mover.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// A feature that the image does not confirm (docs/how_it_works.md, "Observed,
// predicted, ended", the second table). What
// is hidden is held where the others say that it is; what is neither seen nor hidden for more than
// `max_unexplained_frames` in a row, or is known worse than to `max_sigma_px`, or has changed
// slowly, is not what it was taken for and ends. 0 frames: nothing ends here. `predicted`: null
// where the others cannot say; then it stays at the guide.
Move HoldOrEnd(const Eigen::Vector2d& guide,
               const TrajectoryModel::Estimate* predicted,
               const Confirmation& confirmation,
               int max_unexplained_frames,
               double max_sigma_px,
               Feature& feature);

}  // namespace cohort
