#pragma once

#include <map>
#include <optional>
#include <span>

#include "backend/scene/reconstruction.h"
#include "pipelines/evaluation/alignment.h"
#include "pipelines/evaluation/point_error.h"

namespace cohort {

struct ModelTruth {
  std::map<FrameIndex, Rigid3> cam_from_world;  // [m]; frames without truth are left out
  PointTruth point;                             // empty: not known
  // Pairs of true cameras closer than this have no direction to compare (the truth's accuracy).
  double min_baseline_m = 1e-3;
};

// The figures of `evaluate` for a model. A figure that cannot be computed is unset, never 0: all
// but the counts with fewer than 3 registered frames that have ground truth; scale, ATE and
// rpe_trans_m if all cameras coincide; the points' error also if the cameras are on a line, because
// the alignment may then rotate about it (which does not affect the other figures).
struct ModelEvaluation {
  AlignmentStatus alignment = AlignmentStatus::kTooFewPoints;
  std::size_t registered = 0;   // of `frames`
  std::size_t frames = 0;       // of the clip
  std::optional<double> scale;  // true length of one unit of the model [m]
  std::optional<double> ate_m;  // rmse of camera centres after the Sim(3) alignment, as evo
  // ate_m divided by the path's extent, the root mean square distance of the true centres from
  // their mean.
  std::optional<double> ate_share;
  // rmse over neighbouring registered frames, after the alignment.
  std::optional<double> rpe_rot_deg;
  std::optional<double> rpe_trans_m;
  std::optional<double> point_error_median_m;
  std::size_t points_with_truth = 0;
  // Exact area under recall of the relative pose of any two frames with ground truth, up to 5, 10,
  // 20 degrees; 1 is perfect. A pair with an unregistered frame is a failure. Unset for more than
  // 10,000 registered frames, because the number of pairs grows with the square.
  std::optional<double> auc_5;
  std::optional<double> auc_10;
  std::optional<double> auc_20;
};

// `frames`: all frames that the reconstruction should contain.
ModelEvaluation EvaluateModel(const Reconstruction& reconstruction,
                              std::span<const FrameIndex> frames,
                              const ModelTruth& truth);

}  // namespace cohort
