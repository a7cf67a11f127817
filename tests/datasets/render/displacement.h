#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "datasets/render/render.h"
#include "datasets/render/scene_geometry.h"

namespace cohort::test {

// Catmull-Rom.
inline double Cubic(const cv::Mat& image, const Eigen::Vector2d& xy) {
  const Eigen::Vector2d cell = xy.array().floor();
  const Eigen::Vector2d f = xy - cell;
  const auto weights = [](double t) {
    return Eigen::Vector4d(-0.5 * t + t * t - 0.5 * t * t * t,
                           1 - 2.5 * t * t + 1.5 * t * t * t,
                           0.5 * t + 2 * t * t - 1.5 * t * t * t,
                           -0.5 * t * t + 0.5 * t * t * t);
  };
  const Eigen::Vector4d wx = weights(f.x());
  const Eigen::Vector4d wy = weights(f.y());
  double sum = 0.0;
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) {
      sum +=
          wx[i] * wy[j] *
          image.at<float>(static_cast<int>(cell.y()) + j - 1, static_cast<int>(cell.x()) + i - 1);
    }
  }
  return sum;
}

// By how much `image` is displaced against `reference` where pixel i of the reference should lie at
// at[i]: Gauss-Newton on the sum of squares, its slope from central differences [px].
inline Eigen::Vector2d Displacement(const std::vector<double>& reference,
                                    const cv::Mat& image,
                                    const std::vector<Eigen::Vector2d>& at) {
  Eigen::Vector2d d = Eigen::Vector2d::Zero();
  const Eigen::Vector2d ex(0.5, 0.0);
  const Eigen::Vector2d ey(0.0, 0.5);
  for (int iteration = 0; iteration < 4; ++iteration) {
    Eigen::Matrix2d hessian = Eigen::Matrix2d::Zero();
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    for (std::size_t i = 0; i < at.size(); ++i) {
      const Eigen::Vector2d p = at[i] + d;
      const Eigen::Vector2d slope(Cubic(image, p + ex) - Cubic(image, p - ex),
                                  Cubic(image, p + ey) - Cubic(image, p - ey));
      hessian += slope * slope.transpose();
      gradient += (reference[i] - Cubic(image, p)) * slope;
    }
    d += hessian.inverse() * gradient;
  }
  return d;
}

// Does the depth about a pixel jump, or a crease run through it?
inline bool IsUneven(const SceneMoment& moment, const Eigen::Vector2d& middle, int radius) {
  const auto at = [&](int x, int y) { return moment.InverseDepth(middle + Eigen::Vector2d(x, y)); };
  for (int y = -radius; y <= radius; y += 2) {
    for (int x = -radius; x <= radius; x += 2) {
      const double here = at(x, y);
      if (std::abs(at(x - 1, y) + at(x + 1, y) - 2.0 * here) > 1e-3 * here) return true;
      if (std::abs(at(x, y - 1) + at(x, y + 1) - 2.0 * here) > 1e-3 * here) return true;
    }
  }
  return false;
}

struct TruthErrors {
  std::size_t count = 0;
  double median_px = 0.0;
  double p90_px = 0.0;
  double bias_px = 0.0;  // length of the mean
};

// Pixels of one frame about corners on even ground, moved by the truth, should find themselves in
// another frame: by how much they do not.
inline TruthErrors CompareTruthWithPictures(const SyntheticSceneOptions& options,
                                            double first,
                                            double second) {
  const SyntheticScene scene(options);
  const Renderer renderer(scene);
  cv::Mat before;
  cv::Mat after;
  cv::pow(renderer.RenderLight(first), 1.0 / 2.2, before);
  cv::pow(renderer.RenderLight(second), 1.0 / 2.2, after);
  const SceneMoment from(scene, first);
  const SceneMoment to(scene, second);
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(before, corners, 600, 0.01, 6);
  constexpr int kRadius = 6;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  std::vector<double> errors;
  for (const cv::Point2f& corner : corners) {
    const Eigen::Vector2d xy(corner.x, corner.y);
    if (!scene.camera().Contains(xy, kRadius + 2)) continue;
    std::vector<double> reference;
    std::vector<Eigen::Vector2d> at;
    for (int y = -kRadius; y <= kRadius; ++y) {
      for (int x = -kRadius; x <= kRadius; ++x) {
        const Eigen::Vector2d p = xy + Eigen::Vector2d(x, y);
        reference.push_back(before.at<float>(static_cast<int>(p.y()), static_cast<int>(p.x())));
        at.push_back(to.Locate(*from.Pick(p))->xy);
      }
    }
    const Eigen::Vector2d middle = at[at.size() / 2];
    if (!scene.camera().Contains(middle, kRadius + 6)) continue;
    const double depth = to.Locate(*from.Pick(xy))->depth;
    if (to.InverseDepth(middle) * depth > 1.001) continue;  // hidden by now
    if (IsUneven(from, xy, kRadius + 1) || IsUneven(to, middle, kRadius + 2)) continue;
    const Eigen::Vector2d displacement = Displacement(reference, after, at);
    sum += displacement;
    errors.push_back(displacement.norm());
  }
  std::sort(errors.begin(), errors.end());
  if (errors.empty()) return {};
  return {errors.size(),
          errors[errors.size() / 2],
          errors[errors.size() * 9 / 10],
          sum.norm() / static_cast<double>(errors.size())};
}

}  // namespace cohort::test
