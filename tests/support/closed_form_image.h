#pragma once

#include <cmath>
#include <opencv2/core/mat.hpp>

namespace cohort::test {

// A smooth picture known in closed form: value at (x, y), seen shifted by (dx, dy), so that a
// feature at p in the unshifted picture is at p + (dx, dy) in the shifted one. Intensities 0..1.
inline double WavesAt(double x, double y) {
  return 0.5 + 0.12 * std::sin(0.21 * x + 0.03 * y) + 0.1 * std::cos(0.17 * y - 0.05 * x) +
         0.08 * std::sin(0.33 * x - 0.29 * y + 1.0) + 0.06 * std::cos(0.41 * x + 0.37 * y + 0.5);
}

inline cv::Mat WavesImage(int width, int height, double dx, double dy, int depth = CV_8U) {
  cv::Mat image(height, width, CV_32FC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.at<float>(y, x) = static_cast<float>(WavesAt(x - dx, y - dy));
    }
  }
  if (depth == CV_32F) return image;
  cv::Mat converted;
  image.convertTo(converted, depth, depth == CV_8U ? 255.0 : 65535.0);
  return converted;
}

}  // namespace cohort::test
