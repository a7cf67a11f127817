#pragma once

#include <vector>

#include "backend/scene/working_model.h"

namespace cohort {

// The registered frames of a model in runs of consecutive ones, each with its middle as keyframe.
struct FrameRuns {
  std::vector<int> keyframes;     // ascending, one a run
  std::vector<int> run_of_frame;  // by frame: the one that it goes along with; -1: it has no pose
  std::vector<char> is_in_run;    // by frame: does its run speak for it?

  // Are the runs long enough to be worth it?
  bool Condense() const;
};

// Runs so short that most tracks cross several of them, and that the camera sees nearly the same
// from everywhere within one. Where the tracks are so long that they cross very many, some of the runs
// stand for all: their number, and with it the time for a point, has a bound.
FrameRuns ChooseRuns(const WorkingModel& model);

// Bundle adjustment of all registered frames at the price of one of their keyframes. To what the
// frames of a run tell of a point, a keyframe's one observation comes near that has the mean of their
// residuals r_k (A_k: their information, weighed by Cauchy's loss; the mean: r):
//   A = sum A_k,   r = A^-1 sum A_k r_k,   xy = projection in the keyframe - r,   covariance A^-1.
// The keyframes are adjusted to these, and every run goes along with its own. Then every pose by the
// points alone and every point by the poses alone, from the observations as they are: so the result
// is the common adjustment's but for what the camera moved within a run. Time and memory are in
// proportion to the observations.
BundleResult AdjustCondensed(WorkingModel& model,
                             const FrameRuns& runs,
                             const BundleOptions& options);

// Every pose by the points alone, then every point by the poses alone, from the inliers weighed by
// Cauchy's loss that turns at `turn`; the camera stays.
void FollowCamera(WorkingModel& model, double turn);

}  // namespace cohort
