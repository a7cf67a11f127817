#pragma once

#include <memory>

#include "frontend/track/feature_mover.h"
#include "frontend/track/guide.h"
#include "frontend/track/measurement.h"

namespace cohort {

// The paper's tracker: all features move together, from frame to frame, to the minimum of the total
// energy (eq. 3) over a pyramid, with the trajectories of the last L frames as history. Then guide,
// then measure (measurement.h): a position that the image confirms is observed; one that it does
// not confirm is predicted from the feature's own past and the other features (trajectory_model.h),
// until it is seen again or is found to be lost. The history holds the most probable positions.
// README.md of this library lists the steps.
//
// A new feature has no history: its column of the trajectory matrix is filled backwards, frame by
// frame, by the motion of the features around it, corrected by aligning its template with the
// frames of the window (kept for this). So every column is always complete.
//
std::unique_ptr<FeatureMover> MakeSubspaceMover(const SubspaceOptions& options,
                                                const MeasurementOptions& measurement);

// Tracker `descent`: the same without a penalty and without memory, every feature for itself.
std::unique_ptr<FeatureMover> MakeDescentMover(const SubspaceOptions& options);

}  // namespace cohort
