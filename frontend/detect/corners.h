#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <span>
#include <vector>

#include "frontend/core/options.h"

namespace cohort {

// Shi-Tomasi corners on a denoised image, spread over a grid; the same for all trackers.
struct DetectorOptions {
  int max_features = 1000;
  double min_over_noise = 5.0;
  double min_distance_px = 10.0;
  double redetect_below = 0.8;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("max_features",
             o.max_features,
             1,
             100000,
             "The maximum number of features tracked at a time. More features give better cameras "
             "and more points; the time grows in proportion.",
             Tier::kCommon);
    v.Number("min_over_noise",
             o.min_over_noise,
             0.0,
             1e6,
             "minimum corner strength, as a multiple of the strength that the picture's noise "
             "alone has");
    v.Number("min_distance_px",
             o.min_distance_px,
             1.0,
             1000.0,
             "minimum distance between features [px]");
    v.Number(
        "redetect_below",
        o.redetect_below,
        0.0,
        1.0,
        "share of max_features below which the number of live features triggers a new detection");
  }
};

// Shi-Tomasi corners (the smaller eigenvalue of the gradient's structure tensor) of a denoised
// picture, spread over a grid. Every cell gets an equal share of `max_features`, strongest corner
// first; the unused share of cells without texture goes to the strongest corners elsewhere. A
// corner must be min_over_noise times as strong as the picture's noise (the median over the
// picture): in the dark most of the strongest "corners" of a bare wall are noise.
// `gray` is CV_32FC1 (0..1); new corners keep min_distance_px away from the positions `occupied`
// [px]; `mask` (empty or CV_8UC1) is 0 where no corner may be; `border_px` is kept free. Returns at
// most max_new positions, refined to sub-pixel by a parabola, in a fixed order.
std::vector<Eigen::Vector2d> DetectCorners(const cv::Mat& gray,
                                           std::span<const Eigen::Vector2d> occupied,
                                           const cv::Mat& mask,
                                           int border_px,
                                           int max_new,
                                           const DetectorOptions& options);

}  // namespace cohort
