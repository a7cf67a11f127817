#pragma once

#include <Eigen/Core>

#include "frontend/image/pyramid.h"
#include "frontend/track/measure/feature.h"
#include "tests/support/closed_form_image.h"

namespace cohort::test {

// A textured picture that moves by whole-frame shifts: what is at p unshifted is at p + shift.
inline Pyramid ShiftedNoise(const Eigen::Vector2d& shift) {
  return BuildPyramid(
      ImageOf([&](double x, double y) { return NoiseAt(400 + x - shift.x(), 300 + y - shift.y()); },
              240,
              180,
              CV_32F));
}

// Features on a grid of 5 x 4, as born in the unshifted picture.
inline Eigen::Matrix2Xd GridOfTwenty() {
  Eigen::Matrix2Xd x(2, 20);
  for (int f = 0; f < 20; ++f) x.col(f) = Eigen::Vector2d(45 + 35 * (f % 5), 40 + 32 * (f / 5));
  return x;
}

inline std::vector<MeasuredFeature> FeaturesAt(const Pyramid& picture,
                                               const Eigen::Matrix2Xd& x,
                                               const PatchOptions& patch = {}) {
  std::vector<MeasuredFeature> features;
  for (const Eigen::Vector2d xy : x.colwise()) {
    features.push_back(TakeFeature(SmoothPyramid(picture, 0.0), xy, patch));
  }
  return features;
}

}  // namespace cohort::test
