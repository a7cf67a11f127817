#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "frontend/core/options.h"
#include "frontend/image/pyramid.h"

namespace cohort {

// The patch that measures a feature, and the criteria for a valid measurement. The tracker and the
// second pass share them.
struct PatchOptions {
  int window_px = 21;
  int wide_window_px = 31;
  double denoise_sigma_px = 0.8;
  double max_distance_px = 5.0;
  double min_correlation = 0.3;
  double max_residual_ratio = 2.0;
  double warp_noise = 0.003;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Odd("window_px", o.window_px, 5, 63, "side of the measured patch [px]");
    v.Odd("wide_window_px",
          o.wide_window_px,
          5,
          63,
          "side of the patch where a larger one is better [px]");
    v.Number(
        "denoise_sigma_px", o.denoise_sigma_px, 0.0, 10.0, "Gaussian blur before measuring [px]");
    v.Number("max_distance_px",
             o.max_distance_px,
             0.1,
             50.0,
             "maximum distance of a measurement from where the feature was expected [px]");
    v.Number("min_correlation",
             o.min_correlation,
             0.0,
             1.0,
             "minimum correlation of a measurement with the feature's appearance, as a share of "
             "what the noise allows");
    v.Number("max_residual_ratio",
             o.max_residual_ratio,
             1.0,
             100.0,
             "maximum residual variance of a measurement, as a multiple of what noise explains");
    v.Number("warp_noise",
             o.warp_noise,
             0.0,
             1.0,
             "how much a patch may deform beyond what is expected, as a share");
  }
};

// The appearance of a feature where it was anchored, and how it has deformed since. Every later
// frame is measured against the anchor, so that errors do not accumulate from frame to frame.
struct AnchorPatch {
  cv::Mat
      full;  // window and a margin around it, of the full resolution and of the half (may be empty)
  cv::Mat half;
  double signal_variance = 0.0;       // of the window
  double mean_square_gradient = 0.0;  // [1/px^2], of the window, per coordinate
  // Anchor to picture: the pixel at offset v from the feature then is at offset warp v now.
  Eigen::Matrix2d warp = Eigen::Matrix2d::Identity();
  // Covariance of the relative error d of warp, (I + d) warp, in the order 11, 12, 21, 22.
  Eigen::Matrix4d warp_covariance = Eigen::Matrix4d::Zero();
  // Moments of the true gradients per pixel [1/px^2], the mean over gradients_count measurements.
  Eigen::Matrix2d gradients = Eigen::Matrix2d::Zero();
  double gradients_count = 0.0;
};
// `window_px`: the window of the statistics; `largest_px`: the largest window to be measured.
AnchorPatch TakeAnchor(const Pyramid& pyramid,
                       const Eigen::Vector2d& xy,
                       int window_px,
                       int largest_px);
// The pictures alone, without statistics. With a warp, the anchor is resampled so that the warp
// maps it to the picture.
AnchorPatch CopyAnchor(const Pyramid& pyramid,
                       const Eigen::Vector2d& xy,
                       int largest_px,
                       const Eigen::Matrix2d& warp);

// Crops its pictures to what windows of `largest_px` need, so that a thousand stay in the cache.
void NarrowAnchor(int largest_px, AnchorPatch& anchor);

// The share of the anchor's signal variance that small errors of warp and interpolation leave in a
// residual.
inline constexpr double kPatternShare = 0.04;

// The correlation of two windows of one pattern if nothing but noise is between them: with the
// pattern's variance s = first_variance - first_noise, s / sqrt((s + first_noise)(s +
// second_noise)). 0 where noise is all that there is.
double ExpectedCorrelation(double first_variance, double first_noise, double second_noise);

// Picture - anchor over the innermost pixels of the window. It shows whether something occludes the
// feature itself, when the rim of its window may show other surfaces.
struct CenterDifference {
  double mean = 0.0;  // brightness
  double variance = 0.0;
};

// The `noise_factor` of MeasurePatch for a blurred picture where no cohort calibrates it. It may be
// rough, as only the prior of the warp depends on it.
inline constexpr double kBlurredNoiseFactor = 10.0;

struct Measurement {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  int window_px = 0;
  bool converged = false;
  double correlation = 0.0;        // normalised, of anchor and picture, -1..1
  double residual_variance = 0.0;  // of anchor - picture after removing the mean difference
  double residual = 0.0;           // mean |anchor - picture|
  CenterDifference center;
  Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();  // covariance of xy for white noise [px^2]
  Eigen::Matrix2d warp = Eigen::Matrix2d::Identity();   // after this frame
  Eigen::Matrix4d warp_covariance = Eigen::Matrix4d::Zero();
  Eigen::Matrix2d gradients = Eigen::Matrix2d::Zero();  // after this frame
};

// One unconstrained alignment. Gauss-Newton first finds the translation x that minimises
//   sum_u (T(warp^-1 u) - I(x + u) - mean)^2
// over the window, on the half resolution and then on the full, from `start`. One more step
// estimates translation and warp together, with the anchor's warp and covariance as prior: a bright
// patch measures its deformation, a dark one keeps the prior. `noise_factor` is the factor by which
// correlated noise reduces the information of the window's pixels.
// With a prior (its information, [1/px^2]) the start itself counts as a measurement (a maximum a
// posteriori position); then only the full resolution is used.
Measurement MeasurePatch(const Pyramid& current,
                         const AnchorPatch& anchor,
                         const Eigen::Vector2d& start,
                         int window_px,
                         double noise_factor,
                         double noise_variance = 0.0,
                         const Eigen::Matrix2d& prior = Eigen::Matrix2d::Zero());

// Lucas-Kanade: finds the window around `xy` of one picture in the other, from the coarsest level
// to `finest_level`, starting at `start`. The mean difference is ignored. Returns nullopt if a
// level has no texture or the result does not correlate with the window.
std::optional<Eigen::Vector2d> TrackWindow(const Pyramid& from,
                                           const Pyramid& to,
                                           const Eigen::Vector2d& xy,
                                           const Eigen::Vector2d& start,
                                           int window_px,
                                           int finest_level);

// Compares with the feature at `xy`.
CenterDifference CompareCenter(const Pyramid& current,
                               const AnchorPatch& anchor,
                               const Eigen::Vector2d& xy);

}  // namespace cohort
