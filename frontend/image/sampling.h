#pragma once

#include <opencv2/core/mat.hpp>

namespace cohort {

// Samples an n x n patch (n odd) of a CV_32FC1 picture centred at (x, y) [px] by bilinear
// interpolation, row by row into values[n * n]. All samples share the same sub-pixel weights, so
// that a row is two vector multiply-adds. Outside the picture its border pixels repeat.
void SamplePatch(const cv::Mat& picture, double x, double y, int n, float* values);

// The same, with the exact derivative of the interpolant by x and y.
void SamplePatchWithGradient(
    const cv::Mat& picture, double x, double y, int n, float* values, float* dx, float* dy);

inline constexpr int kMaxPatchSide = 65;
inline constexpr int kMaxPatchArea = kMaxPatchSide * kMaxPatchSide;

}  // namespace cohort
