#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "frontend/tracks/track_store.h"

namespace cohort {

// A frame may repeat the picture of the frame before it: 24 frames per second stored at 30, or a
// screen recorder or phone that fills in for missed frames. The camera took one picture, so the
// pair has neither motion nor independent noise.

// How one frame differs from the next.
struct FrameChange {
  double rms = 0.0;  // root mean square difference of the intensities, 0..255
  // The share of the squared difference, at a quarter of the size, that a shift of every block of
  // 8x8 pixels explains to first order: about .3 and less for noise and for the refresh of a still
  // picture by a codec, .45 or more for motion.
  double moved = 0.0;
};
FrameChange ChangeBetween(const cv::Mat& gray, const cv::Mat& next_gray);

// changes[i]: between frames i and i + 1 of a clip. Returns the ascending numbers of the frames
// that repeat the one before. A repeated frame differs from the one before by much less than its
// neighbours differ from each other. Where a codec leaves more than that, the regular order of the
// copies (15, 24 or 25 frames at 30, 24 at 60 ...) decides. Frames of a still or slow clip all
// differ by similar amounts, or only by a codec's noise, and do not count as copies.
std::vector<std::size_t> FindRepeats(const std::vector<FrameChange>& changes);

// "60 of 300 frames repeat the one before; each picture is used once"; empty without any.
std::string DescribeRepeats(const TrackFile& file);

}  // namespace cohort
