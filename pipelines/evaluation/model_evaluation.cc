#include "pipelines/evaluation/model_evaluation.h"

#include <limits>
#include <vector>

#include "pipelines/evaluation/alignment.h"
#include "pipelines/evaluation/trajectory_error.h"

namespace cohort {
namespace {

double Rmse(std::vector<double> errors) { return ComputeStatistics(std::move(errors))->rmse; }

}  // namespace

ModelEvaluation EvaluateModel(const Reconstruction& reconstruction,
                              std::span<const FrameIndex> frames,
                              const ModelTruth& truth) {
  ModelEvaluation evaluation;
  evaluation.frames = frames.size();
  std::vector<PosePair> pairs;
  std::size_t frames_with_truth = 0;
  for (const FrameIndex frame : frames) {
    const auto estimate = reconstruction.cam_from_world.find(frame);
    const auto true_pose = truth.cam_from_world.find(frame);
    const bool registered = estimate != reconstruction.cam_from_world.end();
    const bool has_truth = true_pose != truth.cam_from_world.end();
    if (registered) ++evaluation.registered;
    if (has_truth) ++frames_with_truth;
    if (registered && has_truth) {
      pairs.push_back({estimate->second.Inverse(), true_pose->second.Inverse()});
    }
  }
  if (pairs.size() < 3) return evaluation;

  std::vector<double> pose_errors = RelativePoseErrorsDeg(pairs, truth.min_baseline_m);
  pose_errors.resize(frames_with_truth * (frames_with_truth - 1) / 2,
                     std::numeric_limits<double>::infinity());
  evaluation.auc_5 = AreaUnderRecall(pose_errors, 5.0);
  evaluation.auc_10 = AreaUnderRecall(pose_errors, 10.0);
  evaluation.auc_20 = AreaUnderRecall(pose_errors, 20.0);
  evaluation.rpe_rot_deg = Rmse(ComputeRelativeErrors(pairs, 1, RelativePairs::kAll).rotation_deg);

  std::vector<Eigen::Vector3d> estimated_centres;
  std::vector<Eigen::Vector3d> true_centres;
  for (const PosePair& pair : pairs) {
    estimated_centres.push_back(pair.estimate.translation);
    true_centres.push_back(pair.truth.translation);
  }
  const auto alignment = AlignPoints(estimated_centres, true_centres, AlignmentScale::kEstimated);
  if (!alignment) return evaluation;
  const std::vector<PosePair> aligned = TransformEstimates(*alignment, pairs);
  evaluation.scale = alignment->scale;
  evaluation.ate_m = Rmse(AbsoluteTranslationErrors(aligned));
  evaluation.rpe_trans_m = Rmse(ComputeRelativeErrors(aligned, 1, RelativePairs::kAll).translation);
  if (truth.point) {
    const auto statistics = ComputeStatistics(PointErrors(reconstruction, *alignment, truth.point));
    if (statistics) {
      evaluation.point_error_median_m = statistics->median;
      evaluation.points_with_truth = statistics->count;
    }
  }
  return evaluation;
}

}  // namespace cohort
