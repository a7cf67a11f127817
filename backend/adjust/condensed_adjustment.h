#pragma once

#include <vector>

#include "backend/adjust/working_model.h"

namespace cohort {

// The registered frames of a model in runs of consecutive ones, each with its middle as keyframe.
struct FrameRuns {
  std::vector<int> keyframes;     // ascending, one per run
  std::vector<int> run_of_frame;  // by frame: the run that it moves with; -1: it has no pose
  std::vector<char> is_in_run;    // by frame: whether its run is represented by a keyframe

  // Whether the runs are long enough to save time.
  bool Condense() const;
};

// Chooses runs so short that most tracks cross several of them and that the view hardly changes
// within one. If the tracks cross very many, only some of the runs are used, which bounds their
// number and thus the time per point.
FrameRuns ChooseRuns(const WorkingModel& model);

// Bundle adjustment of all registered frames at the cost of adjusting their keyframes. The frames
// of a run constrain a point nearly as one observation in the keyframe would that has the mean of
// their residuals r_k (A_k: their information, weighted by Cauchy's loss; the mean: r):
//   A = sum A_k,   r = A^-1 sum A_k r_k,   xy = projection in the keyframe - r,   covariance A^-1.
// The keyframes are adjusted to these observations, and every run moves with its keyframe. Then
// every pose is adjusted by the points alone and every point by the poses alone, from the original
// observations. The result is that of the joint adjustment except for the camera's motion within a
// run. Time and memory are proportional to the observations.
BundleResult AdjustCondensed(WorkingModel& model,
                             const FrameRuns& runs,
                             const BundleOptions& options);

// Adjusts every pose by the points alone, then every point by the poses alone, from the inliers
// weighted by Cauchy's loss of scale `turn`; the camera stays.
void FollowCamera(WorkingModel& model, double turn);

}  // namespace cohort
