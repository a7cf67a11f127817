#include "frontend/track/klt_tracker.h"

#include <algorithm>
#include <opencv2/video/tracking.hpp>

namespace cohort {
namespace {

class KltMover final : public FeatureMover {
 public:
  explicit KltMover(const KltOptions& options) : options_(options) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) override {
    std::vector<cv::Mat> pyramid = LkPyramid(current);
    std::vector<cv::Point2f> forward;
    std::vector<cv::Point2f> back;
    std::vector<std::uint8_t> found;
    std::vector<std::uint8_t> found_back;
    std::vector<float> error;
    Flow(previous_, pyramid, positions_, forward, found, error);
    const bool check_back = options_.forward_backward_px > 0.0;
    if (check_back) {
      std::vector<float> ignored;
      Flow(pyramid, previous_, forward, back, found_back, ignored);
    }
    std::vector<Move> moves(positions_.size());
    for (std::size_t f = 0; f < moves.size(); ++f) {
      moves[f].xy = {forward[f].x, forward[f].y};
      moves[f].residual = error[f] / 255.0;
      const bool returned =
          !check_back ||
          (found_back[f] != 0 && cv::norm(back[f] - positions_[f]) <= options_.forward_backward_px);
      if (found[f] == 0 || !returned) moves[f].loss = LossReason::kDiverged;
    }
    positions_ = std::move(forward);
    previous_ = std::move(pyramid);
    return moves;
  }

  void Keep(std::span<const std::uint8_t> keep) override {
    std::size_t kept = 0;
    for (std::size_t f = 0; f < positions_.size(); ++f) {
      if (keep[f] != 0) positions_[kept++] = positions_[f];
    }
    positions_.resize(kept);
  }

  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) override {
    // Without features there was no move, and so no pyramid, in this frame.
    if (positions_.empty()) previous_ = LkPyramid(current);
    for (const auto& xy : born) {
      positions_.emplace_back(static_cast<float>(xy.x()), static_cast<float>(xy.y()));
    }
  }

 private:
  std::vector<cv::Mat> LkPyramid(const Pyramid& current) const {
    cv::Mat gray;
    current.levels.front().convertTo(gray, CV_8U, 255.0);
    std::vector<cv::Mat> pyramid;
    cv::buildOpticalFlowPyramid(
        gray, pyramid, cv::Size(options_.window_px, options_.window_px), options_.max_level);
    return pyramid;
  }

  void Flow(const std::vector<cv::Mat>& from,
            const std::vector<cv::Mat>& to,
            const std::vector<cv::Point2f>& start,
            std::vector<cv::Point2f>& end,
            std::vector<std::uint8_t>& found,
            std::vector<float>& error) const {
    if (start.empty()) return;
    cv::calcOpticalFlowPyrLK(
        from,
        to,
        start,
        end,
        found,
        error,
        cv::Size(options_.window_px, options_.window_px),
        options_.max_level,
        cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 0.01));
  }

  KltOptions options_;
  std::vector<cv::Mat> previous_;
  std::vector<cv::Point2f> positions_;
};

}  // namespace

std::unique_ptr<FeatureMover> MakeKltMover(const KltOptions& options) {
  return std::make_unique<KltMover>(options);
}

}  // namespace cohort
