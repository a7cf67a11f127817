#include "frontend/track/track_loop.h"

#include <chrono>
#include <utility>

#include "frontend/core/error.h"
#include "frontend/detect/corners.h"

namespace cohort {

TrackLoop::TrackLoop(const TrackerOptions& options,
                     cv::Mat mask,
                     std::unique_ptr<FeatureMover> mover)
    : options_(options), mask_(std::move(mask)), mover_(std::move(mover)) {}

std::optional<LossReason> TrackLoop::ReasonToEnd(const Move& move, int unconfirmed_frames) const {
  if (move.loss) return move.loss;
  const double border = options_.border_px;
  if (!(move.xy.x() >= border && move.xy.y() >= border && move.xy.x() <= size_.width - 1 - border &&
        move.xy.y() <= size_.height - 1 - border)) {
    return LossReason::kLeftImage;
  }
  if (!mask_.empty() && mask_.at<std::uint8_t>(static_cast<int>(move.xy.y() + 0.5),
                                               static_cast<int>(move.xy.x() + 0.5)) == 0) {
    return LossReason::kMasked;
  }
  if (unconfirmed_frames > options_.max_unconfirmed_frames) return LossReason::kContradicted;
  return std::nullopt;
}

FrameResult TrackLoop::Track(const Frame& frame) {
  const Pyramid pyramid = BuildPyramid(frame.gray);
  if (!previous_frame_) {
    size_ = frame.gray.size();
    if (!mask_.empty() && mask_.size() != size_) {
      ThrowError("the mask is {}x{}, the frames are {}x{}: give a mask of the frames' size",
                 mask_.cols,
                 mask_.rows,
                 size_.width,
                 size_.height);
    }
  }
  Check(frame.gray.size() == size_, "all frames of a sequence have one size");

  FrameResult result;
  if (!features_.empty()) {
    const std::vector<Move> moves = mover_->MoveFeatures(pyramid);
    Check(moves.size() == features_.size(), "a mover answers for every feature");
    std::vector<std::uint8_t> keep(features_.size(), 1);
    std::vector<Feature> alive;
    alive.reserve(features_.size());
    for (std::size_t f = 0; f < moves.size(); ++f) {
      Feature feature = features_[f];
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
          {feature.id, frame.index, move.xy, move.state, move.residual, move.covariance});
    }
    features_ = std::move(alive);
    mover_->Keep(keep);
  }

  // Features that are only predicted keep their place, but do not count: the picture needs new
  // ones.
  int confirmed = 0;
  for (const Feature& feature : features_) confirmed += feature.unconfirmed_frames == 0 ? 1 : 0;
  if (!previous_frame_ ||
      confirmed < options_.detector.redetect_below * options_.detector.max_features) {
    std::vector<Eigen::Vector2d> occupied;
    for (const Feature& feature : features_) occupied.push_back(feature.xy);
    const std::vector<Eigen::Vector2d> born =
        DetectCorners(pyramid.levels.front(),
                      occupied,
                      mask_,
                      options_.birth_border_px,
                      options_.detector.max_features - confirmed,
                      options_.detector);
    for (const Eigen::Vector2d& xy : born) {
      features_.push_back({FeatureId{next_id_++}, xy, 0});
      result.observations.push_back(
          {features_.back().id, frame.index, xy, ObservationState::kObserved, 0.0, std::nullopt});
    }
    if (!born.empty()) mover_->Add(born, pyramid);
  }
  previous_frame_ = frame.index;
  return result;
}

}  // namespace cohort
