#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// Frames first to last, both included.
struct Stretch {
  FrameIndex first{};
  FrameIndex last{};
};

// The data of a clip once its model has been made or has failed.
struct FilmedClip {
  const TrackFile& file;
  const Reconstruction& model;            // empty if there is none
  std::string termination;                // how the reconstruction ended, as in summary.json
  const std::vector<double>& brightness;  // mean intensity of each of the file's frames, 0..1
  std::size_t features_wanted = 1000;     // that the tracker was to keep alive
  std::vector<Stretch> other_parts = {};  // parts of the clip with their own models
  std::vector<Aside> asides = {};         // frames that do not show the model's scene
};

// The measurements that the advice is based on, of the frames that show the scene.
struct ClipMeasures {
  double observed = 0.0;  // features confirmed in a frame, median over frames
  // Median over the model's points of the widest angle between their first ray and another; unset
  // without points.
  std::optional<double> parallax_deg;
  // The share of tracks, weighted by observations, that no point of the model's static world
  // explains, of tracks of 10 frames or more: the best point is off by 0.25 % of the picture's
  // diagonal or more in half of the frames. Unset without a model.
  std::optional<double> moving_share;
  // Mean intensity, 0..1: the 10th percentile over the frames, the median and the 90th.
  double dark = 0.0;
  double brightness = 0.0;
  double bright = 0.0;
};
ClipMeasures MeasureClip(const FilmedClip& clip);

// The difficulties of a clip and how to film it better: three at most, the likeliest cause first,
// one or two sentences each, for readers without knowledge of reconstruction. Empty if all went
// well; never empty without a model.
std::vector<std::string> FilmAdvice(const FilmedClip& clip, const ClipMeasures& measures);

// A sentence without a full stop on each stretch of frames that does not show the model's scene:
// "frames 0 to 11 are black".
std::vector<std::string> DescribeAsides(const FilmedClip& clip);

}  // namespace cohort
