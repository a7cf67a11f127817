#pragma once

#include <filesystem>

#include "backend/colmap/colmap_mapper.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// The outside baseline: no tracks of ours, but COLMAP's own features and matches of the same
// frames. Defaults are what did best on dark clips (pipelines/README.md).
struct SiftOptions {
  double denoise_sigma_px = 1.0;
  bool stretch = true;
  int max_features = 4000;
  double peak_threshold = 0.002;
  int first_octave = 0;
  bool domain_size_pooling = false;
  bool affine_shape = false;
  int overlap = 10;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("denoise_sigma_px", o.denoise_sigma_px, 0.0, 20.0, "Gaussian blur of the frames [px]");
    v.Flag("stretch", o.stretch, "stretch each frame's contrast to the full range");
    v.Number("max_features", o.max_features, 10, 100000, "a frame");
    v.Number("peak_threshold", o.peak_threshold, 1e-6, 1.0, "least contrast; COLMAP's own: 0.0067");
    v.Number("first_octave", o.first_octave, -1, 4, "-1: of the frame at twice its size");
    v.Flag("domain_size_pooling", o.domain_size_pooling, "descriptors pooled over scales");
    v.Flag("affine_shape", o.affine_shape, "estimate the features' affine shape");
    v.Number("overlap",
             o.overlap,
             1,
             1000,
             "match with so many next frames, and so many at doubling distances");
  }
};

// feature_extractor, sequential_matcher (with quadratic overlap) and mapper of COLMAP on the frames
// that `clip` names below its image_root; its tracks are not used. Intrinsics are kept where they
// are known. Where fewer than 80 % of the frames register at COLMAP's own bounds, once more at
// lower ones. Point ids are COLMAP's. Throws Error without a usable colmap program or frames.
ColmapResult ReconstructWithSift(const TrackFile& clip,
                                 const SiftOptions& sift,
                                 const ColmapOptions& options,
                                 const std::filesystem::path& work_dir);

}  // namespace cohort
