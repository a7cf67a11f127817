#include "frontend/track/baselines/klt_tracker.h"

#include <algorithm>
#include <opencv2/video/tracking.hpp>

#include "frontend/core/keep.h"
#include "frontend/track/baselines/frame_to_frame.h"

namespace cohort {
namespace {

// A picture for TrackByLk: 8 bits, `max_level` levels above full resolution.
std::vector<cv::Mat> LkPyramid(const Pyramid& picture, int window_px, int max_level) {
  std::vector<cv::Mat> pyramid;
  cv::buildOpticalFlowPyramid(
      EightBit(picture), pyramid, cv::Size(window_px, window_px), max_level);
  return pyramid;
}

// OpenCV's pyramidal Lucas-Kanade. The search begins at `guesses`, or at the starts if empty.
PointFlow TrackByLk(const std::vector<cv::Mat>& from,
                    const std::vector<cv::Mat>& to,
                    const std::vector<cv::Point2f>& starts,
                    int window_px,
                    int max_level,
                    const std::vector<cv::Point2f>& guesses = {}) {
  PointFlow flow{guesses, {}};
  if (starts.empty()) return flow;
  cv::calcOpticalFlowPyrLK(
      from,
      to,
      starts,
      flow.ends,
      flow.found,
      cv::noArray(),
      cv::Size(window_px, window_px),
      max_level,
      cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 0.01),
      guesses.empty() ? 0 : cv::OPTFLOW_USE_INITIAL_FLOW);
  return flow;
}

class KltMover final : public FrameToFrameMover {
 public:
  explicit KltMover(const KltOptions& options)
      : FrameToFrameMover(options.forward_backward_px), options_(options) {}

 private:
  std::vector<cv::Mat> Prepare(const Pyramid& current) const override {
    return LkPyramid(current, options_.window_px, options_.max_level);
  }

  PointFlow Flow(const std::vector<cv::Mat>& from,
                 const std::vector<cv::Mat>& to,
                 const std::vector<cv::Point2f>& starts) const override {
    return TrackByLk(from, to, starts, options_.window_px, options_.max_level);
  }

  KltOptions options_;
};

class AnchoredKltMover final : public FeatureMover {
 public:
  explicit AnchoredKltMover(const AnchoredKltOptions& options) : options_(options) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) override {
    const auto picture = Prepare(current);
    std::vector<cv::Point2f> positions;
    for (const AnchoredFeature& feature : features_) positions.push_back(feature.xy);
    const PointFlow guide = TrackByLk(previous_->levels,
                                      picture->levels,
                                      positions,
                                      options_.window_px,
                                      options_.guide_max_level);
    std::vector<Move> moves(features_.size());
    // Features that were born together are neighbours, and are measured together.
    for (std::size_t f = 0; f < features_.size();) {
      const Picture* const anchor = features_[f].anchor.get();
      std::vector<std::size_t> guided;
      for (; f < features_.size() && features_[f].anchor.get() == anchor; ++f) {
        if (guide.found[f] == 0) {
          moves[f].loss = LossReason::kDiverged;
          continue;
        }
        features_[f].xy = guide.ends[f];
        guided.push_back(f);
      }
      MeasureAgainst(*anchor, *picture, guided, moves);
    }
    previous_ = picture;
    return moves;
  }

  void Keep(std::span<const std::uint8_t> keep) override { KeepOnly(keep, features_); }

  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override {
    // Without features, MoveFeatures was not called in this frame and stored no picture.
    if (features_.empty()) previous_ = Prepare(current);
    for (const Eigen::Vector2d& xy : born) {
      const cv::Point2f at(static_cast<float>(xy.x()), static_cast<float>(xy.y()));
      features_.push_back({at, at, previous_, 0});
    }
  }

 private:
  struct Picture {
    std::vector<cv::Mat> levels;  // for Lucas-Kanade
    cv::Mat gray;                 // CV_32FC1
  };
  struct AnchoredFeature {
    cv::Point2f xy;
    cv::Point2f in_anchor;
    std::shared_ptr<const Picture> anchor;  // of its birth
    int unconfirmed_frames = 0;
  };

  std::shared_ptr<const Picture> Prepare(const Pyramid& current) const {
    const int levels = std::max(options_.guide_max_level, options_.anchor_max_level);
    return std::make_shared<Picture>(
        Picture{LkPyramid(current, options_.window_px, levels), current.levels[0]});
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
    const auto track = [&](const Picture& from,
                           const Picture& to,
                           const std::vector<cv::Point2f>& starts,
                           const std::vector<cv::Point2f>& guesses) {
      return TrackByLk(
          from.levels, to.levels, starts, options_.window_px, options_.anchor_max_level, guesses);
    };
    PointFlow measured = track(anchor, picture, in_anchor, guides);
    RequireReturn(in_anchor,
                  track(picture, anchor, measured.ends, in_anchor),
                  options_.forward_backward_px,
                  measured);
    for (std::size_t i = 0; i < features.size(); ++i) {
      AnchoredFeature& feature = features_[features[i]];
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
  std::shared_ptr<const Picture> previous_;
  std::vector<AnchoredFeature> features_;
};

}  // namespace

std::unique_ptr<FeatureMover> MakeKltMover(const KltOptions& options) {
  return std::make_unique<KltMover>(options);
}

std::unique_ptr<FeatureMover> MakeAnchoredKltMover(const AnchoredKltOptions& options) {
  return std::make_unique<AnchoredKltMover>(options);
}

}  // namespace cohort
