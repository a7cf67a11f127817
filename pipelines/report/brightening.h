#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

namespace cohort {

// The intensities of a picture that become black and nearly white when it is brightened for
// viewing.
struct IntensityRange {
  double dark = 0.0;
  double bright = 255.0;
};

// The range without the darkest and the brightest 0.5 % of a picture of one channel.
IntensityRange IntensityRangeOf(const cv::Mat& gray);

// Smooths the ranges of consecutive frames over neighbours within some `sigma_frames`, in the
// logarithm: the film does not flicker with the noise or a lamp, but follows slow changes of light.
inline constexpr double kSteadyFrames = 8.0;  // follows within half a second of most video
std::vector<IntensityRange> Steadied(const std::vector<IntensityRange>& of_frames,
                                     double sigma_frames);

// CV_8UC3, in grey.
cv::Mat Brightened(const cv::Mat& gray, const IntensityRange& range);

}  // namespace cohort
