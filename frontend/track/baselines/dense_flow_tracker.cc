#include "frontend/track/baselines/dense_flow_tracker.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "frontend/track/baselines/frame_to_frame.h"

namespace cohort {
namespace {

// Gaussian blur before the flow [px], as before measuring (PatchOptions).
constexpr double kSmoothingSigmaPx = 0.8;
// Share of both flows' squared lengths that is allowed in addition: equation (5) of Sundaram, Brox,
// Keutzer 2010 (frame_to_frame.h).
constexpr double kReturnShare = 0.01;

// Outside the field its border repeats. There is no flow at a position that is not a number.
cv::Point2f SampleBilinearly(const cv::Mat& flow, const cv::Point2f& at) {
  if (!std::isfinite(at.x) || !std::isfinite(at.y)) return at;
  const float x = std::clamp(at.x, 0.0F, static_cast<float>(flow.cols - 1));
  const float y = std::clamp(at.y, 0.0F, static_cast<float>(flow.rows - 1));
  const int i = std::min(static_cast<int>(x), flow.cols - 2);
  const int j = std::min(static_cast<int>(y), flow.rows - 2);
  const float a = x - static_cast<float>(i);
  const float b = y - static_cast<float>(j);
  const auto* top = flow.ptr<cv::Point2f>(j) + i;
  const auto* bottom = flow.ptr<cv::Point2f>(j + 1) + i;
  return (1 - b) * ((1 - a) * top[0] + a * top[1]) + b * ((1 - a) * bottom[0] + a * bottom[1]);
}

class DenseFlowMover final : public FrameToFrameMover {
 public:
  explicit DenseFlowMover(const DenseFlowOptions& options)
      : FrameToFrameMover({.px = options.forward_backward_px, .share = kReturnShare}) {}

 private:
  std::vector<cv::Mat> Prepare(const Pyramid& current) const override {
    cv::Mat gray = EightBit(current);
    cv::GaussianBlur(gray, gray, cv::Size(), kSmoothingSigmaPx);
    return {gray};
  }

  std::vector<Step> Flow(const std::vector<cv::Mat>& from,
                         const std::vector<cv::Mat>& to,
                         const std::vector<cv::Point2f>& starts) const override {
    cv::Mat field;  // CV_32FC2
    flow_->calc(from[0], to[0], field);
    std::vector<Step> steps;
    for (const cv::Point2f& start : starts) {
      steps.push_back({.end = start + SampleBilinearly(field, start)});
    }
    return steps;
  }

  cv::Ptr<cv::DenseOpticalFlow> flow_ =
      cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
};

}  // namespace

std::unique_ptr<FeatureMover> MakeDenseFlowMover(const DenseFlowOptions& options) {
  return std::make_unique<DenseFlowMover>(options);
}

}  // namespace cohort
