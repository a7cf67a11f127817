#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "frontend/image/frame.h"

namespace cohort {

// Levels of a picture as CV_32FC1 with intensities 0..1. Level 0 is full resolution; each level
// halves both sides (paper 3.3). Pixel (x, y) of level k lies at (2^k x, 2^k y) of level 0.
struct Pyramid {
  std::vector<cv::Mat> levels;
  double step = 1.0 / 255.0;  // of the picture's intensities (IntensityStep)

  int width() const { return levels.empty() ? 0 : levels.front().cols; }
  int height() const { return levels.empty() ? 0 : levels.front().rows; }
};

// One grey level in intensities 0..1: 1/255, or 1/65535 for CV_16U. CV_32F does not state its step,
// so 8 bits are assumed.
double IntensityStep(const cv::Mat& gray);

// `gray` is CV_8UC1, CV_16UC1 or CV_32FC1 (0..1). A level whose shorter side would be below 16 px
// is left out.
Pyramid BuildPyramid(const cv::Mat& gray, int num_levels = 4);
// The same for a frame, which knows the step of a CV_32FC1 picture whose light was changed.
Pyramid BuildPyramid(const Frame& frame, int num_levels = 4);

// The two finest levels of the picture after a Gaussian blur (0: no blur). The blur improves
// least-squares alignment in the dark, where the product of two pictures' noise misleads it.
Pyramid SmoothPyramid(const Pyramid& pyramid, double sigma_px);

}  // namespace cohort
