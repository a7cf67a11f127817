#include "frontend/track/trajectory_model/trajectory_model.h"

#include <algorithm>
#include <utility>

#include "frontend/core/error.h"
#include "frontend/core/in_parallel.h"
#include "frontend/core/keep.h"
#include "frontend/core/part_times.h"
#include "frontend/track/trajectory_model/camera_fit.h"
#include "frontend/track/trajectory_model/feature_fit.h"
#include "frontend/track/trajectory_model/gauge.h"
#include "frontend/track/trajectory_model/rank.h"

namespace cohort {

namespace {

using trajectory_model::CameraFit;
using trajectory_model::JointFit;
using ModelFrame = trajectory_model::Frame;

// Fewer features say too little of a camera: at rank 3 it has eleven unknowns, and each feature
// gives two measurements, of which some are wrong.
constexpr std::ptrdiff_t kLeastFeatures = 8;

}  // namespace

bool TrajectoryModel::CanFit(std::span<const Observation> now) const {
  return !state_.frames.empty() && state_.rank > 0 &&
         std::count_if(now.begin(), now.end(), [](const Observation& o) {
           return o.IsObserved();
         }) >= kLeastFeatures;
}

std::vector<TrajectoryModel::Estimate> TrajectoryModel::Predict(
    std::span<const Observation> now) const {
  const TimedPart part("model");
  if (!CanFit(now)) return {};
  return PredictAllFeatures(state_, FitNewCamera(state_, now));
}

std::vector<TrajectoryModel::Estimate> TrajectoryModel::Update(std::span<const Observation> now) {
  const TimedPart part("model");
  Check(now.size() == state_.features.size(), "the model has the tracker's features");
  const bool fits = CanFit(now);
  ModelFrame frame{{now.begin(), now.end()}, trajectory_model::Camera::Zero(3, state_.rank + 1)};
  if (fits) {
    frame.camera = FitNewCamera(state_, now).camera;
  } else if (!state_.frames.empty()) {
    frame.camera = state_.frames.front().camera;
  }
  state_.frames.push_front(std::move(frame));
  if (state_.frames.size() > max_frames_) state_.frames.pop_back();
  if (state_.rank == 0) return {};
  if (!fits) {
    FitAllFeatures(state_);
    return {};
  }
  // What is new takes more passes; later every frame goes on from the last, and what changes
  // slowly, old cameras and the rank of a rigid scene, is looked at in every fourth.
  constexpr std::size_t kYoungFrames = 8;
  constexpr std::size_t kYoungPasses = 6;
  constexpr std::size_t kTurns = 4;
  const bool young = state_.frames.size() < kYoungFrames;
  turn_ = (turn_ + 1) % kTurns;
  for (std::size_t pass = 0; pass < (young ? kYoungPasses : 1); ++pass) {
    joint_fit_.Step(state_);
    const std::size_t joint = JointFit::FramesOf(state_);
    ForEachInParallel(state_.frames.size() - joint, [&](std::size_t i) {
      const std::size_t l = joint + i;
      if (young || l % kTurns == turn_) RefitCamera(state_, state_.frames[l]);
    });
    FitAllFeatures(state_);
    if (state_.perspective) CenterDepths(state_);
    NormalizeCoordinates(state_);
  }
  if (young || state_.rank < trajectory_model::kRigidRank || turn_ == 0)
    AdaptRank(state_, max_rank_);
  // The camera is that of the joint fit; only its covariance is taken from a fit by itself.
  CameraFit fit = FitNewCamera(state_, state_.frames.front().observations);
  fit.camera = state_.frames.front().camera;
  return PredictAllFeatures(state_, fit);
}

double TrajectoryModel::Misfit(std::size_t feature) const {
  return MisfitOfFeature(state_, feature);
}

void TrajectoryModel::Keep(std::span<const std::uint8_t> keep) {
  Check(keep.size() == state_.features.size(), "the model has the tracker's features");
  KeepOnly(keep, state_.features);
  for (ModelFrame& frame : state_.frames) KeepOnly(keep, frame.observations);
}

void TrajectoryModel::Add(const Eigen::Vector2d& xy) {
  const TimedPart part("model");
  // An anchor is where its corner was found, up to this [px]; it defines the point.
  constexpr double kAnchorSigmaPx = 0.05;
  for (ModelFrame& frame : state_.frames) frame.observations.emplace_back();
  Observation& anchor = state_.frames.front().observations.back();
  anchor.xy = xy;
  anchor.information = Eigen::Matrix2d::Identity() / (kAnchorSigmaPx * kAnchorSigmaPx);
  anchor.anchor = true;
  state_.features.emplace_back();
  if (state_.rank > 0) {
    FitFeature(state_, state_.features.size() - 1);
  } else if (static_cast<std::ptrdiff_t>(state_.features.size()) >= kLeastFeatures) {
    BeginWithPositions(state_);
  }
}

}  // namespace cohort
