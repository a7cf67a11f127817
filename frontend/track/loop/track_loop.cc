#include "frontend/track/loop/track_loop.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "frontend/core/error.h"
#include "frontend/core/stopwatch.h"
#include "frontend/image/mask.h"

namespace cohort {
namespace {

// A feature nearer to the image border ends, because its patch would be cut off [px].
constexpr double kBorderPx = 5.0;
// No feature is born nearer to the border, because it would leave the picture soon; at this
// distance the widest measured patch (31 px) is complete [px].
constexpr int kBirthBorderPx = 16;

}  // namespace

TrackLoop::TrackLoop(const TrackLoopOptions& options, std::unique_ptr<FeatureMover> mover)
    : options_(options), mover_(std::move(mover)) {}

std::optional<LossReason> TrackLoop::ReasonToEnd(const Move& move, int unconfirmed_frames) const {
  if (move.loss) return move.loss;
  if (!(move.xy.x() >= kBorderPx && move.xy.y() >= kBorderPx &&
        move.xy.x() <= size_.width - 1 - kBorderPx &&
        move.xy.y() <= size_.height - 1 - kBorderPx)) {
    return LossReason::kLeftImage;
  }
  if (!mask_.empty() && mask_.at<std::uint8_t>(static_cast<int>(std::lround(move.xy.y())),
                                               static_cast<int>(std::lround(move.xy.x()))) == 0) {
    return LossReason::kMasked;
  }
  if (unconfirmed_frames > options_.max_unconfirmed_frames) return LossReason::kContradicted;
  return std::nullopt;
}

FrameResult TrackLoop::Track(const Frame& frame) {
  CheckMask(frame.mask, frame.gray.size());
  mask_ = frame.mask;
  CheckSize(frame.gray.size());
  Pyramid pyramid = BuildPyramid(frame.gray);
  const LightChange& light = exposure_.Follow(pyramid);
  if (!light.IsNone()) pyramid = BuildPyramid(WithoutLight(frame, light));
  FrameResult result;
  switch (options_.cuts ? watch_.Follow(pyramid) : SceneChange::kNone) {
    case SceneChange::kNone:
      if (!features_.empty()) MoveFeatures(pyramid, frame.index, result);
      break;
    case SceneChange::kBlank:  // the mover continues from the last picture that showed something
      HoldFeatures(frame.index, result);
      previous_frame_ = frame.index;
      return result;
    case SceneChange::kCut:
      EndAtCut(result);
      break;
  }
  // Features that are only predicted keep their places but do not count, because the picture needs
  // new ones.
  const auto confirmed =
      static_cast<int>(std::count_if(features_.begin(), features_.end(), [](const LiveFeature& f) {
        return f.unconfirmed_frames == 0;
      }));
  if (!previous_frame_ || result.cut ||
      confirmed < options_.detector.redetect_below * options_.detector.max_features) {
    DetectFeatures(pyramid, frame.index, options_.detector.max_features - confirmed, result);
  }
  previous_frame_ = frame.index;
  return result;
}

void TrackLoop::CheckSize(const cv::Size& size) {
  if (!previous_frame_) size_ = size;
  Check(size == size_, "all frames of a sequence have one size");
}

// The mover loses all features and starts again with those that are born next, because nothing that
// it knows about the old scene applies to the new one. It keeps its knowledge of the camera's noise
// (CovarianceCalibration).
void TrackLoop::EndAtCut(FrameResult& result) {
  result.cut = true;
  for (const LiveFeature& feature : features_) {
    result.ends.push_back({feature.id, *previous_frame_, LossReason::kCut});
  }
  mover_->Keep(std::vector<std::uint8_t>(features_.size(), 0));
  features_.clear();
}

// All features keep their positions as predicted.
void TrackLoop::HoldFeatures(FrameIndex frame, FrameResult& result) {
  std::vector<Move> moves;
  for (const LiveFeature& feature : features_) {
    Move& move = moves.emplace_back();
    move.xy = feature.xy;
    move.state = ObservationState::kPredicted;
  }
  UseMoves(moves, frame, result);
}

void TrackLoop::MoveFeatures(const Pyramid& pyramid, FrameIndex frame, FrameResult& result) {
  const std::vector<Move> moves = mover_->MoveFeatures(pyramid);
  Check(moves.size() == features_.size(), "a mover returns a result for every feature");
  UseMoves(moves, frame, result);
}

void TrackLoop::UseMoves(std::span<const Move> moves, FrameIndex frame, FrameResult& result) {
  std::vector<std::uint8_t> keep(features_.size(), 1);
  std::vector<LiveFeature> alive;
  alive.reserve(features_.size());
  for (std::size_t f = 0; f < moves.size(); ++f) {
    LiveFeature feature = features_[f];
    const Move& move = moves[f];
    feature.unconfirmed_frames =
        move.state == ObservationState::kPredicted ? feature.unconfirmed_frames + 1 : 0;
    if (const auto reason = ReasonToEnd(move, feature.unconfirmed_frames)) {
      keep[f] = 0;
      result.ends.push_back({feature.id, *previous_frame_, *reason});
      continue;
    }
    feature.xy = move.xy;
    alive.push_back(feature);
    result.observations.push_back(
        {feature.id, frame, move.xy, move.state, move.residual, move.covariance});
  }
  features_ = std::move(alive);
  mover_->Keep(keep);
}

void TrackLoop::DetectFeatures(const Pyramid& pyramid,
                               FrameIndex frame,
                               int max_new,
                               FrameResult& result) {
  std::vector<Eigen::Vector2d> occupied;
  for (const LiveFeature& feature : features_) occupied.push_back(feature.xy);
  const Stopwatch stopwatch;
  const std::vector<Eigen::Vector2d> born = DetectCorners(
      pyramid.levels.front(), occupied, mask_, kBirthBorderPx, max_new, options_.detector);
  result.detect_ms = stopwatch.Milliseconds();
  for (const Eigen::Vector2d& xy : born) {
    features_.push_back({FeatureId{next_id_++}, xy, 0});
    result.observations.push_back(
        {features_.back().id, frame, xy, ObservationState::kObserved, 0.0, std::nullopt});
  }
  if (!born.empty()) mover_->Add(born, pyramid);
}

}  // namespace cohort
