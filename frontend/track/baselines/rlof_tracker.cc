#include "frontend/track/baselines/rlof_tracker.h"

#include <opencv2/optflow/rlofflow.hpp>

#include "frontend/track/baselines/frame_to_frame.h"

namespace cohort {
namespace {

class RlofMover final : public FrameToFrameMover {
 public:
  explicit RlofMover(const RlofOptions& options)
      : FrameToFrameMover(options.forward_backward_px),
        parameters_(cv::optflow::RLOFOpticalFlowParameter::create()) {
    // The adaptive window (SR_CROSS) segments by colour; on noise it only shrinks the window.
    parameters_->setSupportRegionType(cv::optflow::SR_FIXED);
    parameters_->setLargeWinSize(options.window_px);
    parameters_->setMaxLevel(options.max_level);
    parameters_->setUseMEstimator(true);  // Hampel's norm instead of least squares
    // A gain and an offset for every patch would be two more unknowns, and a dark patch contains
    // little information.
    parameters_->setUseIlluminationModel(false);
  }

 private:
  PointFlow Flow(const std::vector<cv::Mat>& from,
                 const std::vector<cv::Mat>& to,
                 const std::vector<cv::Point2f>& starts) const override {
    // In narrower pictures, OpenCV's implementation allocates memory without bound.
    constexpr int kLeastWidthPx = 64;
    parameters_->setUseGlobalMotionPrior(from[0].cols >= kLeastWidthPx);
    PointFlow flow;
    cv::optflow::calcOpticalFlowSparseRLOF(
        from[0], to[0], starts, flow.ends, flow.found, cv::noArray(), parameters_);
    return flow;
  }

  cv::Ptr<cv::optflow::RLOFOpticalFlowParameter> parameters_;
};

}  // namespace

std::unique_ptr<FeatureMover> MakeRlofMover(const RlofOptions& options) {
  return std::make_unique<RlofMover>(options);
}

}  // namespace cohort
