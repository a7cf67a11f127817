#pragma once

#include <opencv2/core/mat.hpp>
#include <string_view>

#include "frontend/image/frame.h"

namespace cohort {

// CV_8UC1 or CV_16UC1 of a 1, 3 (BGR) or 4 (BGRA, alpha dropped) channel picture of 8 or 16 bits.
// Throws Error naming `what` on any other kind.
cv::Mat ToGray(const cv::Mat& picture, std::string_view what);

// CV_8UC1, 0 where a BGRA picture is less than half opaque; empty if it has no alpha, or one alpha
// everywhere: some programs write 32 bits for every pixel and leave the last eight at 0 or 255.
cv::Mat MaskOfAlpha(const cv::Mat& picture);

// Moves a decoded picture into a frame: as grey, in colour if it has any, and with alpha as a mask.
void SetPicture(cv::Mat picture, std::string_view what, Frame& frame);

// Throws Error naming `what` and both sizes unless they are equal.
void RequireSize(cv::Size size, cv::Size expected, std::string_view what);

}  // namespace cohort
