#pragma once

#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "datasets/readers/sequence.h"

namespace cohort {

// Finds what stays fixed in the picture while the rest moves, from pairs of successive pictures k,
// k + 1 of a clip: burnt-in text, logos, black bars, a bonnet, dirt on the lens.
//
// With g the gradients of the slightly blurred pictures, a pixel is fixed if the gradients of
// different pairs agree as well as those within a pair:
//   far = mean over pairs k != l of s_k.s_l / 4, s_k = g_k + g_{k+1};  near = mean of g_k.g_{k+1};
//   far > 0.8 near. Noise has a mean of zero in both.
// Areas that never change inside such an outline, such as bars, are fixed as well.
class FixedParts {
 public:
  // CV_8UC1, CV_16UC1 or CV_32FC1 (0..1), of one size. A pair that shows the same as the last one
  // is left out, so that a still stretch of the clip counts once.
  void Add(const cv::Mat& gray, const cv::Mat& next);
  std::size_t pairs() const { return pairs_; }

  // CV_8UC1, not 0 on fixed parts and within a few pixels of them. Empty if there are none, after
  // too few pairs, or if the rest of the pictures does not move either.
  cv::Mat Find() const;
  // Whether the pictures move beside `fixed` (of Find, or empty). False after too few pairs.
  bool RestMoves(const cv::Mat& fixed) const;

 private:
  struct Gradients {
    cv::Mat x;
    cv::Mat y;

    double Dot(const Gradients& other) const { return x.dot(other.x) + y.dot(other.y); }
  };
  // Over pairs.
  struct Sums {
    Gradients sum;   // of s_k
    cv::Mat near;    // of g_k.g_{k+1}
    cv::Mat energy;  // of |g_k|^2 + |g_{k+1}|^2; with twice `near` the sum of |s_k|^2

    void Add(const Gradients& g, const Gradients& next);
    cv::Mat Far(std::size_t pairs) const;
    cv::Mat Near(std::size_t pairs) const;
    cv::Mat Energy(std::size_t pairs) const;  // of one picture
  };
  static Gradients Of(const cv::Mat& levels, double sigma_px);
  static Gradients Directions(const Gradients& g);
  cv::Mat Standing() const;
  cv::Mat Dead() const;

  std::size_t pairs_ = 0;
  cv::Size size_;  // of the pictures; below, they are smaller by a whole number
  Sums fine_;
  Sums coarse_;
  Gradients last_;  // directions of the last pair's coarse gradients
  cv::Mat least_;   // of each pixel, 0..255
  cv::Mat most_;
};

// What stays fixed in the pictures of a clip; empty if not found.
struct WhatStays {
  cv::Mat parts;    // FixedParts::Find
  cv::Mat pattern;  // FixedPattern::Find
};
// Reads the clip's first frames and rewinds it.
WhatStays FindWhatStays(Sequence& sequence);

// CV_8UC1, 0 where the window of a feature would contain a fixed part.
cv::Mat MaskOfFixedParts(const cv::Mat& fixed);

// Replaces fixed parts of pictures by the nearest other pixels, since their outlines would hold the
// tracker's coarse windows in place.
class PaintOver {
 public:
  PaintOver() = default;
  explicit PaintOver(const cv::Mat& fixed);
  void Apply(cv::Mat& gray) const;  // CV_8UC1, CV_16UC1 or CV_32FC1

 private:
  struct Copy {
    cv::Point from;
    cv::Point to;
  };
  std::vector<Copy> copies_;
};

}  // namespace cohort
