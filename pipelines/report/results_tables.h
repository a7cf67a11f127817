#pragma once

#include <string>

#include "pipelines/experiment/results.h"

namespace cohort {

// For the terminal, at most 120 columns. First the reconstructions, a line for every sequence,
// level, tracker and backend in their order of appearance, marked FAILED where a cell did. Errors
// are medians over the seeds that did not fail:
//   registered     frames with a pose, of all
//   ATE            rmse of camera centres after the Sim(3) alignment with the truth
//   to undegraded  the same against the reconstruction of the undegraded frames (undegraded.h)
//   halves         clips without true cameras: how far the camera paths of two halves of the tracks
//                  disagree, share of the path's extent (evaluation/halves.h); halves that failed,
//                  together or on their own, are infinitely apart in the median
//   in both        frames that both halves registered, of all
//   rotation       rmse of the relative rotation of neighbouring frames
//   point error    median distance to the true surface point, after that alignment
//   reprojection   mean over the model's observations: the model's own residual, not an error
// Then the tracks, which are the same for all backends, a line for every sequence, level, tracker:
//   length             mean number of frames in which the image confirmed a track
//   track error, 90 %  median and 90th percentile of the confirmed positions' distance to the truth
std::string ResultsTables(const ExperimentResults& results);

}  // namespace cohort
