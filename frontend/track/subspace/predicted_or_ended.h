#pragma once

#include <Eigen/Core>

#include "frontend/track/loop/feature_mover.h"
#include "frontend/track/measure/confirmation.h"
#include "frontend/track/measure/feature.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {

// Holds or ends a feature that the image does not confirm (docs/how_it_works.md, "Observed,
// predicted, ended", the second table). A hidden feature is held at its prediction. A feature ends
// if it is neither seen nor hidden for more than `max_unexplained_frames` in a row, if its position
// is uncertain by more than `max_sigma_px`, or if its appearance has changed slowly. With 0 frames
// no feature ends here. `predicted` is null if there is no prediction; then the feature stays at
// the guide.
Move HoldOrEnd(const Eigen::Vector2d& guide,
               const TrajectoryModel::Estimate* predicted,
               const Confirmation& confirmation,
               int max_unexplained_frames,
               double max_sigma_px,
               MeasuredFeature& feature);

}  // namespace cohort
