#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

namespace cohort {

// The intensities of a picture that become black and nearly white when it is brightened for people.
struct IntensityRange {
  double dark = 0.0;
  double bright = 255.0;
};

// All but the darkest and the brightest 0.5 % of a picture of one channel lie between them.
IntensityRange IntensityRangeOf(const cv::Mat& gray);

// Of consecutive frames, each by its neighbours within some `sigma_frames`, in the logarithm: a film
// does not flicker where the noise or a lamp does, and follows where the light grows or fades.
inline constexpr double kSteadyFrames = 8.0;  // follows within half a second of most video
std::vector<IntensityRange> Steadied(const std::vector<IntensityRange>& of_frames,
                                     double sigma_frames);

// CV_8UC3, in greys.
cv::Mat Brightened(const cv::Mat& gray, const IntensityRange& range);

}  // namespace cohort
