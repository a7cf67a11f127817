#pragma once

#include "frontend/core/options.h"

namespace cohort {

enum class TrackerKind { kSubspace, kDescent, kKlt };
inline constexpr ChoiceNames<TrackerKind, 3> kTrackerNames{{{"subspace", TrackerKind::kSubspace},
                                                            {"descent", TrackerKind::kDescent},
                                                            {"klt", TrackerKind::kKlt}}};

// Shi-Tomasi corners on a denoised image, spread over a grid; the same for every tracker.
struct DetectorOptions {
  int max_features = 400;
  int grid_columns = 8;
  int grid_rows = 6;
  double quality = 0.01;
  double min_distance_px = 10.0;
  double denoise_sigma_px = 1.5;
  int block_px = 7;
  double redetect_below = 0.8;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("max_features", o.max_features, 1, 100000, "features alive at a time");
    v.Number("grid_columns",
             o.grid_columns,
             1,
             256,
             "cells across; each gets an equal share of corners");
    v.Number("grid_rows", o.grid_rows, 1, 256, "cells down");
    v.Number("quality",
             o.quality,
             1e-6,
             1.0,
             "least corner strength, as a share of the frame's strongest");
    v.Number("min_distance_px", o.min_distance_px, 1.0, 1000.0, "between features [px]");
    v.Number(
        "denoise_sigma_px", o.denoise_sigma_px, 0.0, 20.0, "Gaussian blur before detection [px]");
    v.Number("block_px", o.block_px, 3, 31, "side of the corner detector's window [px]");
    v.Number(
        "redetect_below",
        o.redetect_below,
        0.0,
        1.0,
        "new corners are sought when the features alive fall below this share of max_features");
  }
};

struct TrackerOptions {
  TrackerKind tracker = TrackerKind::kSubspace;
  DetectorOptions detector;
  // (more to come: klt, subspace, measurement groups)

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice("tracker", o.tracker, kTrackerNames, "which tracker");
    v.Group("detector", o.detector, "corner detection");
  }
};

}  // namespace cohort
