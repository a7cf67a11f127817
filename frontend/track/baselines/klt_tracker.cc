#include "frontend/track/baselines/klt_tracker.h"

#include <algorithm>
#include <map>

#include "frontend/track/baselines/frame_to_frame.h"
#include "frontend/track/baselines/lucas_kanade.h"

namespace cohort {
namespace {

class KltMover final : public FrameToFrameMover {
 public:
  explicit KltMover(const KltOptions& options)
      : FrameToFrameMover({.px = options.forward_backward_px}), options_(options) {}

 private:
  std::vector<cv::Mat> Prepare(const Pyramid& current) const override {
    return LkPyramid(current, options_.window_px, options_.max_level);
  }

  std::vector<Step> Flow(const std::vector<cv::Mat>& from,
                         const std::vector<cv::Mat>& to,
                         const std::vector<cv::Point2f>& starts) const override {
    const auto [ends, found] = TrackByLk(from, to, starts, options_.window_px, options_.max_level);
    std::vector<Step> steps;
    for (std::size_t f = 0; f < starts.size(); ++f) steps.push_back({ends[f], found[f] != 0});
    return steps;
  }

  KltOptions options_;
};

class AnchoredKltMover final : public FeatureMover {
 public:
  explicit AnchoredKltMover(const AnchoredKltOptions& options) : options_(options) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) override {
    const Picture picture = Prepare(current);
    std::vector<cv::Point2f> positions;
    for (const Feature& feature : features_) positions.push_back(feature.xy);
    const LkResult guide = TrackByLk(
        previous_.levels, picture.levels, positions, options_.window_px, options_.guide_max_level);
    std::vector<Move> moves(features_.size());
    std::map<int, std::vector<std::size_t>> features_of_anchor;
    for (std::size_t f = 0; f < features_.size(); ++f) {
      if (guide.found[f] == 0) {
        moves[f].loss = LossReason::kDiverged;
        continue;
      }
      features_[f].xy = guide.ends[f];
      features_of_anchor[features_[f].anchor].push_back(f);
    }
    for (const auto& [anchor, features] : features_of_anchor) {
      MeasureAgainst(anchors_.at(anchor), picture, features, moves);
    }
    previous_ = picture;
    return moves;
  }

  void Keep(std::span<const std::uint8_t> keep) override {
    std::vector<Feature> kept;
    std::map<int, Picture> needed;
    for (std::size_t f = 0; f < features_.size(); ++f) {
      if (keep[f] == 0) continue;
      kept.push_back(features_[f]);
      needed.emplace(features_[f].anchor, anchors_.at(features_[f].anchor));
    }
    features_ = std::move(kept);
    anchors_ = std::move(needed);
  }

  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override {
    // Without features, MoveFeatures was not called in this frame and stored no picture.
    if (features_.empty()) previous_ = Prepare(current);
    anchors_[++last_anchor_] = previous_;
    for (const Eigen::Vector2d& xy : born) {
      const cv::Point2f at(static_cast<float>(xy.x()), static_cast<float>(xy.y()));
      features_.push_back({at, at, last_anchor_, 0});
    }
  }

 private:
  struct Picture {
    std::vector<cv::Mat> levels;  // for Lucas-Kanade
    cv::Mat gray;                 // CV_32FC1
  };
  struct Feature {
    cv::Point2f xy;
    cv::Point2f in_anchor;
    int anchor = 0;  // key of anchors_
    int unconfirmed_frames = 0;
  };

  Picture Prepare(const Pyramid& current) const {
    const int levels = std::max(options_.guide_max_level, options_.anchor_max_level);
    return {LkPyramid(current, options_.window_px, levels), current.levels[0]};
  }

  // Measures these features, which are at their guides, against the picture of their birth.
  void MeasureAgainst(const Picture& anchor,
                      const Picture& picture,
                      const std::vector<std::size_t>& features,
                      std::vector<Move>& moves) {
    std::vector<cv::Point2f> in_anchor;
    std::vector<cv::Point2f> guides;
    for (const std::size_t f : features) {
      in_anchor.push_back(features_[f].in_anchor);
      guides.push_back(features_[f].xy);
    }
    const LkResult measured = TrackThereAndBack(anchor.levels,
                                                picture.levels,
                                                in_anchor,
                                                options_.window_px,
                                                options_.anchor_max_level,
                                                options_.forward_backward_px,
                                                guides);
    for (std::size_t i = 0; i < features.size(); ++i) {
      Feature& feature = features_[features[i]];
      Move& move = moves[features[i]];
      const bool confirmed = measured.found[i] != 0 &&
                             cv::norm(measured.ends[i] - guides[i]) <= options_.max_distance_px;
      if (confirmed) feature.xy = measured.ends[i];
      feature.unconfirmed_frames = confirmed ? 0 : feature.unconfirmed_frames + 1;
      if (feature.unconfirmed_frames > options_.max_unconfirmed_frames) {
        move.loss = LossReason::kContradicted;
      }
      move.xy = {feature.xy.x, feature.xy.y};
      move.state = confirmed ? ObservationState::kObserved : ObservationState::kPredicted;
      move.residual = PatchDifference(anchor.gray, in_anchor[i], picture.gray, feature.xy);
    }
  }

  AnchoredKltOptions options_;
  Picture previous_;
  std::map<int, Picture> anchors_;  // by order of birth
  int last_anchor_ = 0;
  std::vector<Feature> features_;
};

}  // namespace

std::unique_ptr<FeatureMover> MakeKltMover(const KltOptions& options) {
  return std::make_unique<KltMover>(options);
}

std::unique_ptr<FeatureMover> MakeAnchoredKltMover(const AnchoredKltOptions& options) {
  return std::make_unique<AnchoredKltMover>(options);
}

}  // namespace cohort
