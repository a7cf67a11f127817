#pragma once

#include <map>
#include <optional>
#include <vector>

#include "backend/adjust/working_model.h"

namespace cohort {

// The camera parameters that the mapper's bundle adjustments refine; none of a known camera.
struct CameraRefinement {
  bool focal = false;
  bool radial = false;
  bool principal_point = false;
  // The prior of the focal length, see BundleOptions::focal_prior_px.
  double focal_prior_px = 0.0;
  double focal_prior_log_sigma = 1.0;

  bool Any() const { return focal || radial || principal_point; }
};

// Uses Cauchy's loss, with the scale that fits the distribution of the model's residuals.
BundleOptions MapperBundleOptions(const WorkingModel& model,
                                  const CameraRefinement& refinement,
                                  int max_iterations,
                                  double function_tolerance);

// Adjusts the frame and its nearest registered neighbours; farther ones and the camera are fixed.
void AdjustAround(WorkingModel& model, int frame);

// Adjusts all registered frames and their points, condensed if the tracks are long (FrameRuns).
BundleResult AdjustRegistered(WorkingModel& model, const BundleOptions& options);

// Adjusts poses and points briefly, then triangulates the tracks that have no point.
void AdjustAll(WorkingModel& model);

// Alternates between adjusting poses and points and updating the inliers, until little changes.
void AdjustUntilSettled(WorkingModel& model, int max_rounds, int first_iterations);

// Refines the camera with everything else until it stops moving. Each round is a full bundle
// adjustment of at most 60 frames, evenly taken, to its minimum. It then updates the other frames
// and points, the inliers and the noise.
void AdjustCamera(WorkingModel& model, const CameraRefinement& refinement);

// The last step of a reconstruction: adjusts poses and points with the camera held until the
// relative decrease of the cost is below 1e-5. This removes the bend that the condensed adjustment
// leaves along weakly observed directions, such as a stretch before a blank wall. Does nothing for
// more than 300 frames.
void AdjustToMinimum(WorkingModel& model);

// Adjusts the points to all inliers; poses and camera stay.
void AdjustPoints(WorkingModel& model);

// The camera that the tracks imply instead of one that is kept fixed, refined on the keyframes
// alone. Returns nullopt if it does not fit much better.
std::optional<Camera> FindBetterCamera(const WorkingModel& model,
                                       const std::vector<int>& keyframes);

// Scaled by the noise that the model found. The cameras' are those of (omega [rad], centre), see
// CameraPose.
struct ModelCovariances {
  std::map<FrameIndex, Eigen::Matrix<double, 6, 6>> cameras;
  std::map<FeatureId, Eigen::Matrix3d> points;
  std::optional<double> focal;  // relative standard deviation; set if it is refined
  // Standard deviation of every camera's centre, over its three coordinates together, after the
  // best similarity: a share of the root mean square distance of the centres from their mean.
  std::map<FrameIndex, double> centers;
};
// Covariances after one more adjustment of everything, of at most ten iterations, on a copy: the
// model does not change. Returns nullopt if the problem is rank deficient.
std::optional<ModelCovariances> CovariancesAtOptimum(WorkingModel model,
                                                     const CameraRefinement& refinement);

}  // namespace cohort
