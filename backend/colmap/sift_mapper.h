#pragma once

#include <filesystem>
#include <string>

#include "backend/colmap/colmap_mapper.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// The external baseline: COLMAP's own features and matches of the same frames, without our tracks.
// The defaults performed best on dark clips (pipelines/README.md).
struct SiftOptions {
  double denoise_sigma_px = 1.0;
  bool stretch = true;
  int max_features = 4000;
  double peak_threshold = 0.002;
  int first_octave = 0;
  std::string mask;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("denoise_sigma_px",
             o.denoise_sigma_px,
             0.0,
             20.0,
             "standard deviation of the Gaussian blur of the frames before SIFT detection [px]");
    v.Flag("stretch", o.stretch, "stretch each frame's contrast to the full range");
    v.Number("max_features", o.max_features, 10, 100000, "maximum number of features per frame");
    v.Number("peak_threshold",
             o.peak_threshold,
             1e-6,
             1.0,
             "minimum contrast of a feature; COLMAP's default, 0.0067, is too high for dark clips");
    v.Number("first_octave",
             o.first_octave,
             -1,
             4,
             "first octave of the detector: 0 is the frame at its own size, -1 at twice, 1 at half "
             "the size");
    v.Text("mask", o.mask, "mask of the frames' size, black where no features are allowed");
  }
};

// Runs COLMAP's feature_extractor, sequential_matcher (with quadratic overlap) and mapper on the
// frames that `clip` names below its image_root; its tracks are not used. Known intrinsics are
// kept. If fewer than 80 % of the frames register at COLMAP's own bounds, the mapper runs again
// with lower ones. Point ids are COLMAP's. `work_folder` is created if missing; images,
// database.db*, sparse, sparse_lenient and colmap.log in it are replaced. Throws Error without a
// usable colmap program or frames.
ColmapResult ReconstructWithSift(const TrackFile& clip,
                                 const SiftOptions& sift,
                                 const ColmapOptions& options,
                                 const std::filesystem::path& work_folder);

}  // namespace cohort
