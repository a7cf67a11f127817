#pragma once

#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "frontend/track/feature_mover.h"

namespace cohort {

// When a feature has returned: tracked from p by w to the current picture and from there by v back,
//   |w + v|^2 <= px^2 + share (|w|^2 + |v|^2);   px = 0: no check.
// share 0 for trackers of points; for dense flow 0.01 and px^2 = 0.5 (Sundaram, Brox, Keutzer:
// Dense point trajectories by GPU-accelerated large displacement optical flow, ECCV 2010, eq. 5).
struct ReturnCheck {
  double px = 0.0;
  double share = 0.0;
};

// The baselines: every feature for itself, from the last picture to this one, without memory. A
// feature ends that leaves the picture, that the method gives up, or that does not return.
class FrameToFrameMover : public FeatureMover {
 public:
  explicit FrameToFrameMover(const ReturnCheck& check) : check_(check) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) final;
  void Keep(std::span<const std::uint8_t> keep) final;
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) final;

 protected:
  struct Step {
    cv::Point2f end;
    bool found = true;
  };
  // A picture in the form that Flow wants; by default level 0 in 8 bits.
  virtual std::vector<cv::Mat> Prepare(const Pyramid& current) const;
  // One step for every start, of which there is at least one.
  virtual std::vector<Step> Flow(const std::vector<cv::Mat>& from,
                                 const std::vector<cv::Mat>& to,
                                 const std::vector<cv::Point2f>& starts) const = 0;

 private:
  ReturnCheck check_;
  cv::Mat previous_gray_;
  std::vector<cv::Mat> previous_;
  std::vector<cv::Point2f> positions_;
};

// Level 0 of a pyramid as CV_8UC1.
cv::Mat EightBit(const Pyramid& pyramid);

// Mean absolute difference of what two pictures (CV_32FC1) show at two places, 7 x 7.
double PatchDifference(const cv::Mat& a,
                       const cv::Point2f& at_a,
                       const cv::Mat& b,
                       const cv::Point2f& at_b);

}  // namespace cohort
