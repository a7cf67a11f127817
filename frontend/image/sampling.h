#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>

namespace cohort {

inline constexpr int kMaxPatchSide = 65;

// Samples an n x n patch (n odd) of a CV_32FC1 picture centred at (x, y) [px] by bilinear
// interpolation, row by row into values[n * n]. All samples share the same sub-pixel weights, so
// that a row is two vector multiply-adds. Outside the picture its border pixels repeat.
void SamplePatch(const cv::Mat& picture, double x, double y, int n, float* values);

// The same in whole lanes: row r is at values + r * stride. Up to RoundUpToLanes(n) values of it
// are written; those beyond n are undefined.
void SamplePatchInLanes(
    const cv::Mat& picture, double x, double y, int n, float* values, int stride);

// The same in whole lanes, with the exact derivatives of the interpolant with respect to x and y.
void SamplePatchWithGradientInLanes(const cv::Mat& picture,
                                    double x,
                                    double y,
                                    int n,
                                    float* values,
                                    float* dx,
                                    float* dy,
                                    int stride);

// Bilinear samples at center + warp u, for u of an n x n window, in whole lanes as above. Border
// pixels repeat outside the picture.
void SampleWarpedInLanes(const cv::Mat& picture,
                         const Eigen::Vector2d& center,
                         const Eigen::Matrix2d& warp,
                         int n,
                         float* values,
                         int stride);

}  // namespace cohort
