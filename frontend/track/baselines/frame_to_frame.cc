#include "frontend/track/baselines/frame_to_frame.h"

#include <opencv2/core.hpp>
#include <utility>

#include "frontend/core/keep.h"
#include "frontend/image/sampling.h"

namespace cohort {

void RequireReturn(std::span<const cv::Point2f> starts,
                   const PointFlow& back,
                   double return_px,
                   PointFlow& there) {
  for (std::size_t f = 0; f < starts.size(); ++f) {
    const bool returns = back.found[f] != 0 && cv::norm(back.ends[f] - starts[f]) <= return_px;
    if (!returns) there.found[f] = 0;
  }
}

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
  PointFlow flow = Flow(previous_, picture, positions_);
  if (forward_backward_px_ > 0.0) {
    RequireReturn(positions_, Flow(picture, previous_, flow.ends), forward_backward_px_, flow);
  }
  std::vector<Move> moves(positions_.size());
  for (std::size_t f = 0; f < moves.size(); ++f) {
    const cv::Point2f& end = flow.ends[f];
    moves[f].xy = {end.x, end.y};
    if (flow.found[f] == 0 || !moves[f].xy.allFinite()) {
      moves[f].loss = LossReason::kDiverged;
    } else {
      moves[f].residual = PatchDifference(previous_gray_, positions_[f], current.levels[0], end);
    }
  }
  positions_ = std::move(flow.ends);
  previous_ = std::move(picture);
  previous_gray_ = current.levels[0];
  return moves;
}

void FrameToFrameMover::Keep(std::span<const std::uint8_t> keep) { KeepOnly(keep, positions_); }

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
