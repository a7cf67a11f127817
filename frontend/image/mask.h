#pragma once

#include <opencv2/core/mat.hpp>

#include "frontend/core/error.h"

namespace cohort {

// A mask is empty or CV_8UC1, 0 where no feature may be. Throws Error if it does not have the
// frames' size.
inline void CheckMask(const cv::Mat& mask, const cv::Size& frames) {
  if (mask.empty()) return;
  Check(mask.type() == CV_8UC1, "masks have one channel of 8 bits");
  if (mask.size() == frames) return;
  ThrowError("the mask is {}x{}, but the frames are {}x{}: give a mask of the frames' size",
             mask.cols,
             mask.rows,
             frames.width,
             frames.height);
}

}  // namespace cohort
