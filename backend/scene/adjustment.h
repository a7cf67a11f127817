#pragma once

#include <map>
#include <optional>
#include <vector>

#include "backend/scene/working_model.h"

namespace cohort {

// So many of these frames, from the first to the last.
std::vector<int> Spread(const std::vector<int>& frames, std::size_t count);

// What the mapper's bundle adjustments refine of the camera. Nothing of one that is known.
struct CameraRefinement {
  bool focal = false;
  bool radial = false;
  bool principal_point = false;
  // What is known of the focal length beforehand: BundleOptions::focal_prior_px.
  double focal_prior_px = 0.0;
  double focal_prior_log_sigma = 1.0;

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

// Poses and points, briefly, then points for the tracks that have none.
void AdjustAll(WorkingModel& model);

// Poses and points, then what the result agrees with, until little changes.
void AdjustUntilSettled(WorkingModel& model, int max_rounds, int first_iterations);

// All that is refined of a camera, with everything else, until nothing moves: full bundle adjustments of
// at most 60 frames, evenly taken, each to its minimum and followed by the other frames
// and points and by the inliers and the noise that the result has.
void AdjustCamera(WorkingModel& model, const CameraRefinement& refinement);

// The last step of a reconstruction: poses and points together, the camera held, until the cost does not
// fall by more than 1e-5 of itself. What the condensed adjustment leaves is a bend along directions that
// few observations hold, such as a stretch before a blank wall. Of more than 300 frames, nothing.
void AdjustToMinimum(WorkingModel& model);

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
  // Standard deviation of every camera's centre, of its three coordinates together, after the best
  // similarity: a share of the root mean square distance of the centres from their mean.
  std::map<FrameIndex, double> centers;
};
// Where a last adjustment of everything, of a copy of the model and of at most ten iterations, leads:
// that they are asked for changes no model. None where the problem is rank deficient.
std::optional<ModelCovariances> CovariancesAtOptimum(WorkingModel model,
                                                     const CameraRefinement& refinement);

}  // namespace cohort
