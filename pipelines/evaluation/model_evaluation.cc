#include "pipelines/evaluation/model_evaluation.h"

#include <cmath>
#include <limits>
#include <vector>

#include "frontend/core/statistics.h"
#include "pipelines/evaluation/trajectory_error.h"

namespace cohort {
namespace {

constexpr std::size_t kMostPosesInPairs = 10'000;  // 0.4 GB of errors

// The poses (world_from_cam) of registered frames that have truth, and the counts of registered
// frames and of frames with truth.
struct Paired {
  std::vector<PosePair> pairs;
  std::size_t registered = 0;
  std::size_t with_truth = 0;
};

Paired PairWithTruth(const Reconstruction& reconstruction,
                     std::span<const FrameIndex> frames,
                     const std::map<FrameIndex, Rigid3>& true_cam_from_world) {
  Paired paired;
  for (const FrameIndex frame : frames) {
    const auto estimate = reconstruction.cam_from_world.find(frame);
    const auto truth = true_cam_from_world.find(frame);
    const bool registered = estimate != reconstruction.cam_from_world.end();
    const bool has_truth = truth != true_cam_from_world.end();
    if (registered) ++paired.registered;
    if (has_truth) ++paired.with_truth;
    if (registered && has_truth) {
      paired.pairs.push_back({estimate->second.Inverse(), truth->second.Inverse()});
    }
  }
  return paired;
}

Alignment AlignCentres(std::span<const PosePair> pairs) {
  std::vector<Eigen::Vector3d> estimated;
  std::vector<Eigen::Vector3d> truth;
  for (const PosePair& pair : pairs) {
    estimated.push_back(pair.estimate.translation);
    truth.push_back(pair.truth.translation);
  }
  return FitAlignment(estimated, truth, AlignmentScale::kEstimated);
}

}  // namespace

ModelEvaluation EvaluateModel(const Reconstruction& reconstruction,
                              std::span<const FrameIndex> frames,
                              const ModelTruth& truth) {
  const Paired paired = PairWithTruth(reconstruction, frames, truth.cam_from_world);
  const std::vector<PosePair>& pairs = paired.pairs;
  ModelEvaluation evaluation;
  evaluation.frames = frames.size();
  evaluation.registered = paired.registered;
  if (pairs.size() < 3) return evaluation;

  if (pairs.size() <= kMostPosesInPairs) {
    const std::vector<double> pose_errors = RelativePoseErrorsDeg(pairs, truth.min_baseline_m);
    const std::size_t of_frames = paired.with_truth * (paired.with_truth - 1) / 2;
    evaluation.auc_5 = AreaUnderRecall(pose_errors, 5.0, of_frames);
    evaluation.auc_10 = AreaUnderRecall(pose_errors, 10.0, of_frames);
    evaluation.auc_20 = AreaUnderRecall(pose_errors, 20.0, of_frames);
  }
  evaluation.rpe_rot_deg = Rmse(ComputeRelativeErrors(pairs).rotation_deg);

  const Alignment alignment = AlignCentres(pairs);
  evaluation.alignment = alignment.status;
  if (!alignment.FixesDistances()) return evaluation;
  const Sim3& truth_from_model = alignment.target_from_source;
  const std::vector<PosePair> aligned = TransformEstimates(truth_from_model, pairs);
  evaluation.scale = truth_from_model.scale;
  evaluation.ate_m = Rmse(AbsoluteTranslationErrors(aligned));
  std::vector<Eigen::Vector3d> truth_centres;
  for (const PosePair& pair : pairs) truth_centres.push_back(pair.truth.translation);
  evaluation.ate_share = *evaluation.ate_m / Extent(truth_centres);
  evaluation.rpe_trans_m = Rmse(ComputeRelativeErrors(aligned).translation);
  if (truth.point && alignment.status == AlignmentStatus::kUnique) {
    const std::vector<double> errors = PointErrors(reconstruction, truth_from_model, truth.point);
    if (!errors.empty()) {
      evaluation.point_error_median_m = InterpolatedMedian(errors);
      evaluation.points_with_truth = errors.size();
    }
  }
  return evaluation;
}

}  // namespace cohort
