#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <vector>

#include "frontend/image/pyramid.h"

namespace cohort {

// OpenCV's pyramidal Lucas-Kanade for points.
struct LkResult {
  std::vector<cv::Point2f> ends;
  std::vector<std::uint8_t> found;
};

// A picture for TrackByLk: 8 bits, `max_level` levels above full resolution.
std::vector<cv::Mat> LkPyramid(const Pyramid& picture, int window_px, int max_level);

// Tracks `starts` to the other picture; the search begins at `guesses`, or at the starts if empty.
LkResult TrackByLk(const std::vector<cv::Mat>& from,
                   const std::vector<cv::Mat>& to,
                   const std::vector<cv::Point2f>& starts,
                   int window_px,
                   int max_level,
                   const std::vector<cv::Point2f>& guesses = {});

// The same with a forward-backward check: `found` is set only for points that return to within
// `return_px` of their start. With `guesses` the way back begins at the starts.
LkResult TrackThereAndBack(const std::vector<cv::Mat>& from,
                           const std::vector<cv::Mat>& to,
                           const std::vector<cv::Point2f>& starts,
                           int window_px,
                           int max_level,
                           double return_px,
                           const std::vector<cv::Point2f>& guesses = {});

}  // namespace cohort
