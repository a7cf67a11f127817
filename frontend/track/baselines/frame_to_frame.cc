#include "frontend/track/baselines/frame_to_frame.h"

#include <opencv2/core.hpp>
#include <utility>

#include "frontend/image/sampling.h"

namespace cohort {

double PatchDifference(const cv::Mat& a,
                       const cv::Point2f& at_a,
                       const cv::Mat& b,
                       const cv::Point2f& at_b) {
  constexpr int kSide = 7;
  cv::Mat patch_a(kSide, kSide, CV_32F);
  cv::Mat patch_b(kSide, kSide, CV_32F);
  SamplePatch(a, at_a.x, at_a.y, kSide, patch_a.ptr<float>());
  SamplePatch(b, at_b.x, at_b.y, kSide, patch_b.ptr<float>());
  return cv::norm(patch_a, patch_b, cv::NORM_L1) / (kSide * kSide);
}

cv::Mat EightBit(const Pyramid& pyramid) {
  cv::Mat gray;
  pyramid.levels.front().convertTo(gray, CV_8U, 255.0);
  return gray;
}

std::vector<cv::Mat> FrameToFrameMover::Prepare(const Pyramid& current) const {
  return {EightBit(current)};
}

std::vector<Move> FrameToFrameMover::MoveFeatures(const Pyramid& current) {
  std::vector<cv::Mat> picture = Prepare(current);
  const std::vector<Step> forward = Flow(previous_, picture, positions_);
  std::vector<cv::Point2f> ends;
  for (const Step& step : forward) ends.push_back(step.end);
  const bool check = check_.px > 0.0;
  const std::vector<Step> back = check ? Flow(picture, previous_, ends) : std::vector<Step>();

  std::vector<Move> moves(positions_.size());
  for (std::size_t f = 0; f < moves.size(); ++f) {
    moves[f].xy = {ends[f].x, ends[f].y};
    bool lost = !forward[f].found;
    if (check && !lost) {
      const cv::Point2d w = ends[f] - positions_[f];
      const cv::Point2d v = back[f].end - ends[f];
      const double limit = check_.px * check_.px + check_.share * (w.dot(w) + v.dot(v));
      lost = !back[f].found || !((w + v).dot(w + v) <= limit);
    }
    if (lost || !moves[f].xy.allFinite()) {
      moves[f].loss = LossReason::kDiverged;
    } else {
      moves[f].residual =
          PatchDifference(previous_gray_, positions_[f], current.levels[0], ends[f]);
    }
  }
  positions_ = std::move(ends);
  previous_ = std::move(picture);
  previous_gray_ = current.levels[0];
  return moves;
}

void FrameToFrameMover::Keep(std::span<const std::uint8_t> keep) {
  std::size_t kept = 0;
  for (std::size_t f = 0; f < positions_.size(); ++f) {
    if (keep[f] != 0) positions_[kept++] = positions_[f];
  }
  positions_.resize(kept);
}

void FrameToFrameMover::Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) {
  if (positions_.empty()) {  // without features MoveFeatures was not called and stored no picture
    previous_ = Prepare(current);
    previous_gray_ = current.levels[0];
  }
  for (const auto& xy : born) {
    positions_.emplace_back(static_cast<float>(xy.x()), static_cast<float>(xy.y()));
  }
}

}  // namespace cohort
