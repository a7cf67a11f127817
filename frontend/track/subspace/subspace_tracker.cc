#include "frontend/track/subspace/subspace_tracker.h"

#include <Eigen/LU>
#include <algorithm>
#include <optional>
#include <utility>

#include "frontend/core/in_parallel.h"
#include "frontend/core/part_times.h"
#include "frontend/track/measure/covariance_calibration.h"
#include "frontend/track/measure/frame_measurement.h"
#include "frontend/track/measure/there_and_back.h"
#include "frontend/track/subspace/anchor_deformation.h"
#include "frontend/track/subspace/guide_mover.h"
#include "frontend/track/subspace/history_filler.h"
#include "frontend/track/subspace/predicted_or_ended.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {
namespace {

// Of so many frames the trajectory model is made; a feature may be hidden for as many.
constexpr std::size_t kModelFrames = 31;
// From so many frames of history on, the other features are believed.
constexpr std::size_t kEnoughHistory = 4;

class SubspaceMover final : public FeatureMover {
 public:
  SubspaceMover(const SubspaceOptions& options, const MeasurementOptions& measurement)
      : options_(options), measurement_(measurement) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) override;
  void Keep(std::span<const std::uint8_t> keep) override;
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override;

 private:
  // Where the other features say that each is; none where they are too few.
  struct Others {
    std::vector<TrajectoryModel::Estimate> predicted;
    bool strong = false;  // what contradicts them is not observed
  };

  Eigen::Matrix2Xd Measure(const Pyramid& current,
                           const Pyramid& smooth,
                           const Eigen::Matrix2Xd& start,
                           std::optional<FrameMeasurement>& frame);
  Others AskOthers(FrameMeasurement& frame);
  Move Observe(const Measurement& m, const Confirmation& confirmation, Feature& feature) const;
  Eigen::Matrix2Xd Fuse(const FrameMeasurement& frame, std::vector<Move>& moves);
  void Begin(const Pyramid& current);

  SubspaceOptions options_;
  MeasurementOptions measurement_;
  std::vector<Feature> features_;
  JointGuide guide_{options_};
  HistoryFiller filler_{measurement_.patch};
  Pyramid previous_;
  CovarianceCalibration calibration_;
  TrajectoryModel model_{kModelFrames, measurement_.max_rank, measurement_.perspective};
};

// The steps of docs/how_it_works.md, "One frame".
std::vector<Move> SubspaceMover::MoveFeatures(const Pyramid& current) {
  const TimedPart part("bookkeeping");
  const PatchOptions& patch = measurement_.patch;
  Pyramid smooth;
  Eigen::Matrix2Xd start;
  ForEachInParallel(2, [&](std::size_t i) {
    if (i == 0) smooth = SmoothPyramid(current, patch.denoise_sigma_px);
    if (i == 1) start = guide_.Start(current);
  });

  // 1. to 3. The guide; from there a large patch, tested; then against what the other features say.
  std::optional<FrameMeasurement> measured;
  const Eigen::Matrix2Xd starts = Measure(current, smooth, start, measured);
  FrameMeasurement& frame = *measured;
  const Others others = AskOthers(frame);
  // Else from the prediction, a large and a small patch.
  frame.MeasureAtPredictions(others.predicted, others.strong);

  std::vector<Move> moves;
  for (std::size_t f = 0; f < features_.size(); ++f) {
    Feature& feature = features_[f];
    const auto* predicted = others.predicted.empty() ? nullptr : &others.predicted[f];
    // What is not seen there either is predicted or ended.
    moves.push_back(frame.IsObserved(f)
                        ? Observe(frame.measurement(f), frame.confirmation(), feature)
                        : HoldOrEnd(starts.col(static_cast<Eigen::Index>(f)),
                                    predicted,
                                    frame.confirmation(),
                                    measurement_.max_unexplained_frames,
                                    patch.max_distance_px,
                                    feature));
  }

  Eigen::Matrix2Xd fused = Fuse(frame, moves);
  for (std::size_t f = 0; f < features_.size(); ++f) {
    if (!moves[f].xy.allFinite()) moves[f].loss = LossReason::kDiverged;
    features_[f].confirmed = moves[f].state == ObservationState::kObserved;
  }
  guide_.Remember(current, std::move(fused), features_);
  previous_ = current;
  filler_.Remember(std::move(smooth), static_cast<std::size_t>(options_.history_length));
  return moves;
}

// Measures every feature from the guide's position and, where it is not seen from there, from where
// Lucas-Kanade finds it. Returns the starts.
Eigen::Matrix2Xd SubspaceMover::Measure(const Pyramid& current,
                                        const Pyramid& smooth,
                                        const Eigen::Matrix2Xd& start,
                                        std::optional<FrameMeasurement>& frame) {
  Eigen::Matrix2Xd joint = guide_.Minimize(current, features_, start).x;
  const Eigen::Matrix2Xd& before = guide_.history().front();
  const auto starts_with = [&](std::span<const std::size_t> tracked) {
    return BetterStarts(
        previous_, current, before, joint, tracked, features_, options_.template_px);
  };
  const auto measure = [&](const Eigen::Matrix2Xd& starts) {
    frame.emplace(smooth, features_, measurement_.patch, calibration_, starts);
  };
  const Eigen::Matrix2d similarity = CommonSimilarity(before, joint, features_);
  DeformAnchors(similarity, measurement_.patch.warp_noise, features_);
  measure(joint);

  std::vector<std::size_t> confirmed;
  std::vector<std::size_t> lost;
  for (std::size_t f = 0; f < features_.size(); ++f) {
    if (!features_[f].confirmed) continue;
    confirmed.push_back(f);
    if (!frame->IsObserved(f)) lost.push_back(f);
  }
  if (lost.empty()) return joint;
  // If more than this share is lost, what is seen at the others may be chance.
  constexpr double kManyLost = 0.2;
  if (static_cast<double>(lost.size()) <= kManyLost * static_cast<double>(confirmed.size())) {
    Eigen::Matrix2Xd starts = starts_with(lost);
    frame->MeasureFromBetter(lost, starts);
    return starts;
  }
  // The camera is too fast for the guide, whose similarity is not that of its motion either.
  Eigen::Matrix2Xd starts = starts_with(confirmed);
  DeformAnchors(CommonSimilarity(before, starts, features_) * similarity.inverse(), 0.0, features_);
  measure(starts);
  return starts;
}

// What looks like its anchor tells the model of this frame, and the model where all should be. With
// a strong constraint, what is elsewhere is not observed. What remains calibrates the covariances.
SubspaceMover::Others SubspaceMover::AskOthers(FrameMeasurement& frame) {
  const std::size_t history = guide_.history().size();
  const auto longest = static_cast<std::size_t>(options_.history_length);
  Others others;
  others.predicted = model_.Predict(frame.observed());
  others.strong = options_.constraint == Constraint::kStrong && !others.predicted.empty() &&
                  history >= std::min(kEnoughHistory, longest);
  if (others.strong) frame.TestPositions(others.predicted);
  // An occluder that arrives at the rim has moved the last position already.
  for (std::size_t f = 0; f < features_.size() && history > kEnoughHistory; ++f) {
    if (features_[f].confirmed && !frame.IsObserved(f)) model_.Forget(f);
  }
  if (others.predicted.empty()) return others;
  if (history >= kEnoughHistory) calibration_.Update(frame.Residuals(others.predicted));
  others.predicted = model_.Predict(frame.observed());
  return others;
}

Move SubspaceMover::Observe(const Measurement& m,
                            const Confirmation& confirmation,
                            Feature& feature) const {
  confirmation.Learn(m, feature);
  feature.unexplained_frames = 0;
  Move move;
  move.xy = m.xy;
  move.residual = m.residual;
  move.covariance = PixelCovariance::From(calibration_.Covariance(m.shape));
  return move;
}

// The frame enters the model. Returns the most probable positions, which are the next frame's
// history, and gives them to what is predicted.
Eigen::Matrix2Xd SubspaceMover::Fuse(const FrameMeasurement& frame, std::vector<Move>& moves) {
  const std::vector<TrajectoryModel::Estimate> fused = model_.Update(frame.observed());
  Eigen::Matrix2Xd x(2, static_cast<Eigen::Index>(moves.size()));
  for (std::size_t f = 0; f < moves.size(); ++f) {
    Move& move = moves[f];
    // No other feature's history pays for one that the model has lost.
    const bool is_fused = !fused.empty() && fused[f].xy.allFinite();
    x.col(static_cast<Eigen::Index>(f)) = is_fused ? fused[f].xy : move.xy;
    if (fused.empty()) continue;
    // What strays more than its noise from what the others say (a corner where two surfaces
    // overlap) is worth less than its gradients promise.
    if (move.covariance) {
      move.covariance =
          PixelCovariance::From(std::max(1.0, model_.Misfit(f)) * move.covariance->Matrix());
    }
    if (measurement_.fuse || move.state == ObservationState::kPredicted) move.xy = fused[f].xy;
  }
  return x;
}

void SubspaceMover::Keep(std::span<const std::uint8_t> keep) {
  const TimedPart part("bookkeeping");
  KeepFeatures(keep, features_);
  guide_.Keep(keep);
  model_.Keep(keep);
}

void SubspaceMover::Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) {
  const TimedPart part("births");
  if (features_.empty()) Begin(current);
  std::vector<Feature> features(born.size());
  std::vector<FilledHistory> pasts(born.size());
  ForEachInParallel(born.size(), [&](std::size_t i) {
    features[i] =
        TakeFeature(current, filler_.newest(), born[i], options_.template_px, measurement_.patch);
    pasts[i] = filler_.Fill(born[i], features[i].anchor, guide_.history(), calibration_);
  });
  std::vector<std::vector<Eigen::Vector2d>> births;
  for (std::size_t i = 0; i < born.size(); ++i) {
    features_.push_back(std::move(features[i]));
    model_.Add(pasts[i].measured);
    births.push_back(std::move(pasts[i].xy));
  }
  guide_.Add(births, current, features_);
}

// The first features, or none survived: the window starts here.
void SubspaceMover::Begin(const Pyramid& current) {
  guide_.Begin(current);
  filler_.Begin(SmoothPyramid(current, measurement_.patch.denoise_sigma_px));
  previous_ = current;
  model_ = TrajectoryModel(kModelFrames, measurement_.max_rank, measurement_.perspective);
  model_.Update({});
}

}  // namespace

std::unique_ptr<FeatureMover> MakeSubspaceMover(const SubspaceOptions& options,
                                                const MeasurementOptions& measurement) {
  if (!measurement.enabled) return MakeGuideMover(options, measurement.patch);
  return std::make_unique<SubspaceMover>(options, measurement);
}

}  // namespace cohort
