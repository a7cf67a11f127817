#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <span>
#include <vector>

#include "frontend/track/loop/feature_mover.h"

namespace cohort {

// Where points move to from one picture to another.
struct PointFlow {
  std::vector<cv::Point2f> ends;
  std::vector<std::uint8_t> found;  // 0: given up
};

// The forward-backward check: clears `found` for points that `back`, the flow of there.ends to the
// first picture, does not bring to within `return_px` of their starts.
void RequireReturn(std::span<const cv::Point2f> starts,
                   const PointFlow& back,
                   double return_px,
                   PointFlow& there);

// The baselines track every feature independently from the last picture to this one, without
// memory. A feature ends if it leaves the picture, if the method gives it up, or if it fails the
// forward-backward check.
class FrameToFrameMover : public FeatureMover {
 public:
  explicit FrameToFrameMover(double forward_backward_px)  // 0: no check
      : forward_backward_px_(forward_backward_px) {}

  std::vector<Move> MoveFeatures(const Pyramid& current) final;
  void Keep(std::span<const std::uint8_t> keep) final;
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) final;

 protected:
  // A picture in the form that Flow takes; by default level 0 in 8 bits.
  virtual std::vector<cv::Mat> Prepare(const Pyramid& current) const;
  // There is at least one start.
  virtual PointFlow Flow(const std::vector<cv::Mat>& from,
                         const std::vector<cv::Mat>& to,
                         const std::vector<cv::Point2f>& starts) const = 0;

 private:
  double forward_backward_px_;
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
