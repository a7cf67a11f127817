#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "datasets/truth/track_truth.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// A frame with the tracks that are alive in it, and how many there are.
struct TrackPicture {
  cv::Mat picture;  // CV_8UC3
  std::size_t observed = 0;
  std::size_t predicted = 0;
  std::size_t known = 0;       // observed, with known ground truth
  std::size_t near_truth = 0;  // of these, at most 1 px from it
  std::size_t far = 0;         // of these, more than 3 px from it
};

// Draws a frame (CV_8UC3) with each track's last positions as a line and the current one as a dot:
// filled if observed, a ring of another colour if predicted. With ground truth the colour shows the
// error (up to 1 px, up to 3 px, beyond) and a white cross marks the true position.
TrackPicture DrawTracks(const cv::Mat& picture,
                        FrameIndex frame,
                        const TrackSet& tracks,
                        TrackTruth* truth);

// For the src of an HTML image.
std::string JpegDataUri(const cv::Mat& picture, int quality = 80);

}  // namespace cohort
