#pragma once

#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "frontend/track/loop/feature_mover.h"

namespace cohort {

// The forward-backward check. A feature moves from p by w to the current picture, and tracking back
// from there moves it by v. It passes if
//   |w + v|^2 <= px^2 + share (|w|^2 + |v|^2);   px = 0: no check.
// share is 0 for point trackers. Dense flow uses 0.01 and px^2 = 0.5 (Sundaram, Brox, Keutzer:
// Dense point trajectories by GPU-accelerated large displacement optical flow, ECCV 2010, eq. 5).
struct ReturnCheck {
  double px = 0.0;
  double share = 0.0;
};

// The baselines track every feature independently from the last picture to this one, without
// memory. A feature ends if it leaves the picture, if the method gives it up, or if it fails the
// forward-backward check.
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
  // A picture in the form that Flow takes; by default level 0 in 8 bits.
  virtual std::vector<cv::Mat> Prepare(const Pyramid& current) const;
  // Returns one step for every start; there is at least one.
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

// Mean absolute difference of two pictures (CV_32FC1) at two positions, 7 x 7.
double PatchDifference(const cv::Mat& a,
                       const cv::Point2f& at_a,
                       const cv::Mat& b,
                       const cv::Point2f& at_b);

}  // namespace cohort
