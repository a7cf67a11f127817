#include "frontend/image/pyramid.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "frontend/core/error.h"
#include "frontend/core/part_times.h"

namespace cohort {

double IntensityStep(const cv::Mat& gray) {
  return gray.depth() == CV_16U ? 1.0 / 65535.0 : 1.0 / 255.0;
}

Pyramid BuildPyramid(const cv::Mat& gray, int num_levels) {
  const TimedPart part("pyramid");
  Check(!gray.empty() && gray.channels() == 1, "BuildPyramid takes one-channel pictures");
  Pyramid pyramid;
  pyramid.step = IntensityStep(gray);
  cv::Mat full;
  switch (gray.depth()) {
    case CV_8U:
    case CV_16U:
      gray.convertTo(full, CV_32F, pyramid.step);
      break;
    default:
      Check(gray.depth() == CV_32F, "BuildPyramid takes 8-bit, 16-bit or float pictures");
      full = gray;
  }
  pyramid.levels.push_back(full);
  while (static_cast<int>(pyramid.levels.size()) < num_levels) {
    const cv::Mat& above = pyramid.levels.back();
    if (std::min(above.cols, above.rows) / 2 < 16) break;
    cv::Mat below;
    cv::pyrDown(above, below);  // 5-tap Gaussian; keeps pixel (0, 0) in place
    pyramid.levels.push_back(below);
  }
  return pyramid;
}

Pyramid BuildPyramid(const Frame& frame, int num_levels) {
  Pyramid pyramid = BuildPyramid(frame.gray, num_levels);
  if (frame.gray.depth() == CV_32F) pyramid.step = frame.float_step;
  return pyramid;
}

Pyramid SmoothPyramid(const Pyramid& pyramid, double sigma_px) {
  const TimedPart part("pyramid");
  Pyramid smooth;
  smooth.step = pyramid.step;
  if (sigma_px <= 0.0) {
    smooth.levels.assign(pyramid.levels.begin(),
                         pyramid.levels.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(
                                                      2, pyramid.levels.size())));
    return smooth;
  }
  smooth.levels.emplace_back();
  cv::GaussianBlur(pyramid.levels[0], smooth.levels[0], cv::Size(0, 0), sigma_px);
  if (pyramid.levels.size() > 1) {
    smooth.levels.emplace_back();
    cv::pyrDown(smooth.levels[0], smooth.levels[1]);
  }
  return smooth;
}

}  // namespace cohort
