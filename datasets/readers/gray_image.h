#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string_view>

#include "frontend/image/frame.h"

namespace cohort {

// The pixels of an image file as stored (EXIF orientation is ignored, as COLMAP does), or as another
// of OpenCV's flags has them. Throws Error if the file is missing, unreadable, cut short, no image or
// one of more than 2^30 pixels.
cv::Mat ReadImage(const std::filesystem::path& file, int flags = cv::IMREAD_UNCHANGED);

// CV_8UC1 or CV_16UC1 of a 1, 3 (BGR) or 4 (BGRA, alpha dropped) channel picture of 8 or 16 bits.
// Throws Error naming `what` on any other kind.
cv::Mat ToGray(const cv::Mat& picture, std::string_view what);

// Moves the pixels of a decoded picture into a frame: as grey, and in colours if it has any.
void SetPicture(cv::Mat picture, std::string_view what, Frame& frame);

// Throws Error naming `what` and both sizes unless they are equal.
void RequireSize(cv::Size size, cv::Size expected, std::string_view what);

}  // namespace cohort
