#pragma once

#include <map>
#include <optional>
#include <vector>

#include "backend/scene/working_model.h"

namespace cohort {

// What the mapper's bundle adjustments refine of the camera. Nothing of one that is known.
struct CameraRefinement {
  bool focal = false;
  bool radial = false;
  bool principal_point = false;

  bool Any() const { return focal || radial || principal_point; }
};

// Robust by Cauchy's loss, which turns where the distribution of the model's residuals has it.
BundleOptions MapperBundleOptions(const WorkingModel& model,
                                  const CameraRefinement& refinement,
                                  int max_iterations,
                                  double function_tolerance);

// The frame and its nearest registered neighbours, held by those beyond; the camera stays.
void AdjustAround(WorkingModel& model, int frame);

// All registered frames and their points: condensed, where the tracks are long (FrameRuns).
BundleResult AdjustRegistered(WorkingModel& model, const BundleOptions& options);

// Everything, briefly, then points for the tracks that have none.
void AdjustAll(WorkingModel& model, const CameraRefinement& refinement);

// Everything, then what the result agrees with, until little changes.
void AdjustUntilSettled(WorkingModel& model,
                        const CameraRefinement& refinement,
                        int max_rounds,
                        int first_iterations);

// Everything, as far as it goes: a guessed camera moves long after the inliers have settled. Not for a
// known one: on the real clips that were tried most cameras came out the same, some better and some
// worse, and it took longer.
void AdjustToOptimum(WorkingModel& model, const CameraRefinement& refinement);

// The points from all inliers; poses and camera stay.
void AdjustPoints(WorkingModel& model);

// What the tracks say of a camera that is kept: refined on the keyframes alone. None where they
// have no better one to offer.
std::optional<Camera> FindBetterCamera(const WorkingModel& model,
                                       const std::vector<int>& keyframes);

// Scaled by the noise that the model found: of (omega [rad], centre), see CameraPose, and of
// points.
struct ModelCovariances {
  std::map<FrameIndex, Eigen::Matrix<double, 6, 6>> cameras;
  std::map<FeatureId, Eigen::Matrix3d> points;
  std::optional<double> focal;  // relative standard deviation, where it is refined
};
// Where a last adjustment of everything, of a copy of the model and of at most ten iterations, leads:
// that they are asked for changes no model. None where the problem is rank deficient.
std::optional<ModelCovariances> CovariancesAtOptimum(WorkingModel model,
                                                     const CameraRefinement& refinement);

}  // namespace cohort
