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

// Baseline: pyramidal Lucas-Kanade of OpenCV with a forward-backward check.
struct KltOptions {
  int window_px = 21;
  int max_level = 3;
  double forward_backward_px = 1.0;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("window_px", o.window_px, 3, 101, "side of the tracked patch [px], odd");
    v.Number("max_level", o.max_level, 0, 8, "pyramid levels above full resolution");
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.0,
             100.0,
             "a feature ends if tracking back misses its start by more [px]; 0: no check");
  }
};

struct TrackerOptions {
  TrackerKind tracker = TrackerKind::kSubspace;
  double border_px = 5.0;
  int birth_border_px = 16;
  int max_unconfirmed_frames = 30;
  DetectorOptions detector;
  KltOptions klt;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice("tracker", o.tracker, kTrackerNames, "which tracker");
    v.Number(
        "border_px", o.border_px, 0.0, 100.0, "a feature nearer to the image border ends [px]");
    v.Number("birth_border_px",
             o.birth_border_px,
             1,
             200,
             "no new features nearer to the image border [px]");
    v.Number("max_unconfirmed_frames",
             o.max_unconfirmed_frames,
             0,
             100000,
             "a feature that the image has not confirmed for more frames in a row ends");
    v.Group("detector", o.detector, "corner detection");
    v.Group("klt", o.klt, "tracker klt");
  }
};

}  // namespace cohort
