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
  // Pairs of true cameras closer than this have no direction to compare (the truth's own accuracy).
  double min_baseline_m = 1e-3;
};

// What `evaluate` says of a model. A figure that cannot be computed is absent, never 0: all but the
// counts with fewer than 3 registered frames that have truth; scale, ATE and rpe_trans_m where all
// cameras are in one place; the points' error also where they are on a line, as the alignment may
// then turn about it (which changes none of the other figures).
struct ModelEvaluation {
  AlignmentStatus alignment = AlignmentStatus::kTooFewPoints;
  std::size_t registered = 0;   // of `frames`
  std::size_t frames = 0;       // that the clip has
  std::optional<double> scale;  // true length of one unit of the model [m]
  std::optional<double> ate_m;  // rmse of camera centres after the Sim(3) alignment, as evo
  // ate_m over the path's extent, the root mean square distance of the true centres from their
  // mean.
  std::optional<double> ate_share;
  // rmse over neighbouring registered frames, after the alignment.
  std::optional<double> rpe_rot_deg;
  std::optional<double> rpe_trans_m;
  std::optional<double> point_error_median_m;
  std::size_t points_with_truth = 0;
  // Exact area under recall of the relative pose of any two frames with truth, up to 5, 10, 20
  // degrees, 1 is perfect; a pair with a frame that is not registered is a failure. Of more than
  // 10,000 registered frames there is none: pairs grow with the square.
  std::optional<double> auc_5;
  std::optional<double> auc_10;
  std::optional<double> auc_20;
};

// `frames`: all frames that the reconstruction should have.
ModelEvaluation EvaluateModel(const Reconstruction& reconstruction,
                              std::span<const FrameIndex> frames,
                              const ModelTruth& truth);

}  // namespace cohort
