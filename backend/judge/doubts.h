#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "backend/adjust/lens_changes.h"
#include "backend/adjust/working_model.h"
#include "backend/judge/judgement.h"
#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// What is known about a model that is returned.
struct JudgedModel {
  const TrackFile& file;
  std::span<const WorkingModel> parts;  // of the clip, the largest first
  std::size_t chosen;                   // which of them the model is
  const Judgement& judgement;           // of it
  const Reconstruction& reconstruction;
  const Camera& camera;                 // the given one, or that which the search found
  std::optional<Camera> rival;          // FoundCamera::rival
  std::optional<Camera> better_camera;  // CeresFindings, as the next ones
  std::optional<double> expected_error;
  std::optional<double> focal_sigma;
  std::optional<LensChanges> lens_changes;
};

// All doubts about it, in the order in which they are shown.
std::vector<Doubt> DoubtsOf(const JudgedModel& judged);

// The doubt about cameras that may be off by more than 1 % of the extent of their path. Half of the
// clips with truth are off by more than expected, and one in twenty by 2.6 times as much
// (docs/results/unknown_camera.md).
std::optional<Doubt> DoubtExpectedError(double expected_error);

// The spread of the points' views across their best-fitting line divided by that along it, median
// over frames: RMS distances in the picture; 1 if they have no direction.
double SpreadAcrossLine(const Reconstruction& reconstruction);

// The doubt about frames that are constrained by few points, both in number and compared with the
// other frames. Covariances do not reveal it: a few features on a blank wall drift together, and
// the model follows them.
std::optional<Doubt> DoubtFewPoints(const Reconstruction& reconstruction);

// Robust standard deviation of a coordinate of the inliers' reprojection errors [px]. It is hardly
// larger than the noise of the tracks (EstimateNoise), unless the camera is wrong or the tracks
// drift.
double NoiseLeftPx(const WorkingModel& model);

// The doubt about a model that leaves much more noise than the tracks themselves have.
std::optional<Doubt> DoubtNoise(const WorkingModel& model);

}  // namespace cohort
