#pragma once

#include <opencv2/core/mat.hpp>

namespace cohort {

// Finds columns and rows to which a sensor adds a brightness of their own in all pictures.
//
// A and B are profiles of two halves of a clip: the means of all their pictures over columns (or
// rows), without what is smooth. The scene moves from one half to the other, and noise is
// independent, so K(d) = mean of A(x) B(x + d) is the energy of the pattern at d = 0. A pattern has
// no neighbours: K(0) must be many times K(3..8 px), which is never true of a scene that hardly
// moves.
//
// Patterns of single pixels, such as hot ones, are not subtracted: that did harm, since the noise
// of their estimate is itself a fixed pattern.
class FixedPattern {
 public:
  // Successive pictures, CV_8UC1, CV_16UC1 or CV_32FC1 (0..1), of one size; those of the clip's
  // first half, then those of its second half. Keeps the last one, which must not change.
  void Add(const cv::Mat& gray, bool second_half);

  // CV_32FC1 in levels of 255, to be subtracted from each picture. Empty if there is none, or if it
  // is too faint beside the change from picture to picture to matter. Where `fixed` (CV_8UC1, or
  // empty) is not 0, pictures are not used: what FixedParts found.
  cv::Mat Find(const cv::Mat& fixed) const;

 private:
  struct Half {
    cv::Mat sum;  // in units of the pictures
    int frames = 0;
  };
  Half halves_[2];
  cv::Mat last_;
  double change_ = 0.0;  // the sum of mean squares of differences of successive pictures [levels^2]
  double unit_ = 1.0;    // levels in a unit of the pictures
};

// Subtracts a pattern of FixedPattern from a picture, CV_8UC1, CV_16UC1 or CV_32FC1.
void SubtractPattern(const cv::Mat& pattern, cv::Mat& gray);

}  // namespace cohort
