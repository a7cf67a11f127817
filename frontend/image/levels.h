#pragma once

#include <opencv2/core/mat.hpp>

namespace cohort {

// The value of white in a picture, CV_8UC1, CV_16UC1 or CV_32FC1.
inline double WhiteLevelOf(const cv::Mat& gray) {
  return gray.depth() == CV_8U ? 255.0 : gray.depth() == CV_16U ? 65535.0 : 1.0;
}

// The same as CV_32FC1, in levels of which white has 255.
inline cv::Mat LevelsOf(const cv::Mat& gray) {
  cv::Mat levels;
  gray.convertTo(levels, CV_32F, 255.0 / WhiteLevelOf(gray));
  return levels;
}

}  // namespace cohort
