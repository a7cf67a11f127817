#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string>

#include "frontend/tracks/observation.h"

namespace cohort {

// One decoded picture of a sequence.
struct Frame {
  FrameIndex index{};
  std::int64_t timestamp_ns = 0;
  std::string name;  // path relative to the sequence's image folder; for a video frame_000123.png
  cv::Mat gray;  // CV_8UC1 or CV_16UC1, as decoded (colour is converted by OpenCV's BGR weights; a
                 // video's is its luma); CV_32FC1 (0..1) where its light was changed (exposure.h)
  cv::Mat color = {};  // as decoded, BGR or BGRA of 8 or 16 bits; empty without colour,
                       // or grey if `gray` is not as decoded (MaskedSequence)
  cv::Mat mask = {};   // CV_8UC1, 0 where no feature may be; empty: anywhere
  double float_step = 1.0 / 255.0;  // of the intensities of a CV_32FC1 gray, in its light
};

}  // namespace cohort
