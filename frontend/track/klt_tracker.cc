#include "frontend/track/klt_tracker.h"

#include <opencv2/video/tracking.hpp>

#include "frontend/track/frame_to_frame.h"

namespace cohort {
namespace {

class KltMover final : public FrameToFrameMover {
 public:
  explicit KltMover(const KltOptions& options)
      : FrameToFrameMover({.px = options.forward_backward_px}), options_(options) {}

 private:
  cv::Size Window() const { return {options_.window_px, options_.window_px}; }

  std::vector<cv::Mat> Prepare(const Pyramid& current) const override {
    std::vector<cv::Mat> pyramid;
    cv::buildOpticalFlowPyramid(EightBit(current), pyramid, Window(), options_.max_level);
    return pyramid;
  }

  std::vector<Step> Flow(const std::vector<cv::Mat>& from,
                         const std::vector<cv::Mat>& to,
                         const std::vector<cv::Point2f>& starts) const override {
    std::vector<cv::Point2f> ends;
    std::vector<std::uint8_t> found;
    cv::calcOpticalFlowPyrLK(
        from,
        to,
        starts,
        ends,
        found,
        cv::noArray(),
        Window(),
        options_.max_level,
        cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 30, 0.01));
    std::vector<Step> steps;
    for (std::size_t f = 0; f < starts.size(); ++f) steps.push_back({ends[f], found[f] != 0});
    return steps;
  }

  KltOptions options_;
};

}  // namespace

std::unique_ptr<FeatureMover> MakeKltMover(const KltOptions& options) {
  return std::make_unique<KltMover>(options);
}

}  // namespace cohort
