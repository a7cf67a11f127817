#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "frontend/core/random_stream.h"

namespace cohort::test {

// A smooth picture known in closed form: value at (x, y), seen shifted by (dx, dy), so that a
// feature at p in the unshifted picture is at p + (dx, dy) in the shifted one. Intensities 0..1.
inline double WavesAt(double x, double y) {
  return 0.5 + 0.12 * std::sin(0.21 * x + 0.03 * y) + 0.1 * std::cos(0.17 * y - 0.05 * x) +
         0.08 * std::sin(0.33 * x - 0.29 * y + 1.0) + 0.06 * std::cos(0.41 * x + 0.37 * y + 0.5);
}

// Blurred spots at random places: unlike the waves, no shift repeats it.
inline double SpotsAt(double x, double y) {
  struct Spot {
    double x, y, inverse_variance, height;
  };
  static const std::vector<Spot> kSpots = [] {
    RandomStream random(11, "test/spots");
    std::vector<Spot> spots;
    for (int i = 0; i < 250; ++i) {
      const double radius = random.Uniform(3, 20);
      spots.push_back({random.Uniform(-60, 700),
                       random.Uniform(-60, 540),
                       1.0 / (radius * radius),
                       random.Uniform(-0.35, 0.35)});
    }
    return spots;
  }();
  double value = 0.5;
  for (const Spot& s : kSpots) {
    const double r2 = ((x - s.x) * (x - s.x) + (y - s.y) * (y - s.y)) * s.inverse_variance;
    if (r2 < 30.0) value += s.height * std::exp(-0.5 * r2);
  }
  return std::clamp(value, 0.0, 1.0);
}

// Smooth noise of four octaves, wavelengths 7 to 56 px: texture without an end and without repeats.
inline double NoiseAt(double x, double y) {
  const auto lattice = [](std::int64_t i, std::int64_t j, int octave) {
    std::uint64_t h = static_cast<std::uint64_t>(i) * 0x9e3779b97f4a7c15ULL ^
                      static_cast<std::uint64_t>(j) * 0xc2b2ae3d27d4eb4fULL ^
                      static_cast<std::uint64_t>(octave) * 0x165667b19e3779f9ULL;
    h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9ULL;
    h = (h ^ (h >> 27)) * 0x94d049bb133111ebULL;
    return static_cast<double>((h ^ (h >> 31)) >> 11) * 0x1.0p-53 - 0.5;
  };
  const auto smooth = [](double t) { return t * t * t * (t * (6 * t - 15) + 10); };
  double value = 0.5;
  double wavelength = 7.0;
  double height = 0.3;
  for (int octave = 0; octave < 4; ++octave) {
    const double u = x / wavelength;
    const double v = y / wavelength;
    const auto i = static_cast<std::int64_t>(std::floor(u));
    const auto j = static_cast<std::int64_t>(std::floor(v));
    const double a = smooth(u - static_cast<double>(i));
    const double b = smooth(v - static_cast<double>(j));
    const double top = lattice(i, j, octave) * (1 - a) + lattice(i + 1, j, octave) * a;
    const double bottom = lattice(i, j + 1, octave) * (1 - a) + lattice(i + 1, j + 1, octave) * a;
    value += height * (top * (1 - b) + bottom * b);
    wavelength *= 2.0;
    height *= 1.1;
  }
  return std::clamp(value, 0.0, 1.0);
}

template <typename Function>
cv::Mat ImageOf(const Function& value_at, int width, int height, int depth) {
  cv::Mat image(height, width, CV_32FC1);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      image.at<float>(y, x) = static_cast<float>(value_at(x, y));
    }
  }
  if (depth == CV_32F) return image;
  cv::Mat converted;
  image.convertTo(converted, depth, depth == CV_8U ? 255.0 : 65535.0);
  return converted;
}

inline cv::Mat WavesImage(int width, int height, double dx, double dy, int depth = CV_8U) {
  return ImageOf([=](double x, double y) { return WavesAt(x - dx, y - dy); }, width, height, depth);
}

inline cv::Mat SpotsImage(int width, int height, double dx, double dy, int depth = CV_8U) {
  return ImageOf([=](double x, double y) { return SpotsAt(x - dx, y - dy); }, width, height, depth);
}

}  // namespace cohort::test
