#include "frontend/track/subspace/subspace_tracker.h"

#include <algorithm>
#include <utility>

#include "frontend/core/in_parallel.h"
#include "frontend/core/keep.h"
#include "frontend/core/part_times.h"
#include "frontend/track/measure/covariance_calibration.h"
#include "frontend/track/measure/frame_measurement.h"
#include "frontend/track/subspace/anchor_deformation.h"
#include "frontend/track/subspace/guide.h"
#include "frontend/track/subspace/guide_mover.h"
#include "frontend/track/subspace/predicted_or_ended.h"
#include "frontend/track/trajectory_model/trajectory_model.h"

namespace cohort {
namespace {

// Of so many frames the trajectory model is made; a feature may be hidden for as many.
constexpr std::size_t kModelFrames = 31;
// The other features are believed once there are this many frames.
constexpr int kEnoughFrames = 4;

class SubspaceMover final : public FeatureMover {
 public:
  SubspaceMover(const SubspaceOptions& options, const MeasurementOptions& measurement)
      : is_strong_(options.constraint == Constraint::kStrong),
        measurement_(measurement),
        guide_(MakeGuide(options)) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) override;
  void Keep(std::span<const std::uint8_t> keep) override;
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override;

 private:
  // Where the other features say that each is; none where they are too few.
  struct Others {
    std::vector<TrajectoryModel::Estimate> predicted;
    bool strong = false;  // what contradicts them is not observed
  };

  std::vector<std::uint8_t> Confirmed() const;
  Others AskOthers(FrameMeasurement& frame);
  Move Observe(const Measurement& m,
               const Confirmation& confirmation,
               MeasuredFeature& feature) const;
  Eigen::Matrix2Xd Fuse(const FrameMeasurement& frame, std::vector<Move>& moves);
  void Begin(const Pyramid& current);

  bool is_strong_;
  MeasurementOptions measurement_;
  std::vector<MeasuredFeature> features_;
  std::unique_ptr<Guide> guide_;
  Pyramid smooth_;  // the newest picture, denoised for measuring
  int frames_ = 1;  // since the first features
  CovarianceCalibration calibration_;
  TrajectoryModel model_{kModelFrames, measurement_.max_rank, measurement_.perspective};
};

// The steps of docs/how_it_works.md, "One frame".
std::vector<Move> SubspaceMover::MoveFeatures(const Pyramid& current) {
  const TimedPart part("bookkeeping");
  const PatchOptions& patch = measurement_.patch;
  smooth_ = SmoothPyramid(current, patch.denoise_sigma_px);
  const Eigen::Matrix2Xd starts = guide_->Find(current, Confirmed());
  DeformAnchors(
      CommonSimilarity(guide_->positions(), starts, features_), patch.warp_noise, features_);

  // 1. to 3. The guide; from there a large patch, tested; then against what the other features say.
  FrameMeasurement frame(smooth_, features_, patch, calibration_, starts);
  const Others others = AskOthers(frame);
  // Else from the prediction, a large and a small patch.
  frame.MeasureAtPredictions(others.predicted, others.strong);

  std::vector<Move> moves;
  for (std::size_t f = 0; f < features_.size(); ++f) {
    MeasuredFeature& feature = features_[f];
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

  const Eigen::Matrix2Xd fused = Fuse(frame, moves);
  for (std::size_t f = 0; f < features_.size(); ++f) {
    if (!moves[f].xy.allFinite()) moves[f].loss = LossReason::kDiverged;
    features_[f].confirmed = moves[f].state == ObservationState::kObserved;
  }
  guide_->Remember(current, fused, Confirmed());
  ++frames_;
  return moves;
}

std::vector<std::uint8_t> SubspaceMover::Confirmed() const {
  std::vector<std::uint8_t> confirmed;
  for (const MeasuredFeature& feature : features_) confirmed.push_back(feature.confirmed ? 1 : 0);
  return confirmed;
}

// What looks like its anchor tells the model of this frame, and the model where all should be. With
// a strong constraint, what is elsewhere is not observed. What remains calibrates the covariances.
SubspaceMover::Others SubspaceMover::AskOthers(FrameMeasurement& frame) {
  Others others;
  others.predicted = model_.Predict(frame.observed());
  others.strong = is_strong_ && !others.predicted.empty() && frames_ >= kEnoughFrames;
  if (others.strong) frame.TestPositions(others.predicted);
  if (others.predicted.empty()) return others;
  if (frames_ >= kEnoughFrames) calibration_.Update(frame.Residuals(others.predicted));
  others.predicted = model_.Predict(frame.observed());
  return others;
}

Move SubspaceMover::Observe(const Measurement& m,
                            const Confirmation& confirmation,
                            MeasuredFeature& feature) const {
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
    if (move.state == ObservationState::kPredicted) move.xy = fused[f].xy;
  }
  return x;
}

void SubspaceMover::Keep(std::span<const std::uint8_t> keep) {
  const TimedPart part("bookkeeping");
  KeepOnly(keep, features_);
  guide_->Keep(keep);
  model_.Keep(keep);
}

void SubspaceMover::Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) {
  const TimedPart part("births");
  if (features_.empty()) Begin(current);
  std::vector<MeasuredFeature> features(born.size());
  ForEachInParallel(born.size(), [&](std::size_t i) {
    features[i] = TakeFeature(smooth_, born[i], measurement_.patch);
  });
  for (std::size_t i = 0; i < born.size(); ++i) {
    features_.push_back(std::move(features[i]));
    model_.Add(born[i]);
  }
  guide_->Add(born, current);
}

// The first features, or none survived: the window starts here.
void SubspaceMover::Begin(const Pyramid& current) {
  guide_->Begin(current);
  smooth_ = SmoothPyramid(current, measurement_.patch.denoise_sigma_px);
  frames_ = 1;
  model_ = TrajectoryModel(kModelFrames, measurement_.max_rank, measurement_.perspective);
  model_.Update({});
}

}  // namespace

std::unique_ptr<FeatureMover> MakeSubspaceMover(const SubspaceOptions& options,
                                                const MeasurementOptions& measurement) {
  if (!measurement.enabled) return MakeGuideMover(options);
  return std::make_unique<SubspaceMover>(options, measurement);
}

}  // namespace cohort
