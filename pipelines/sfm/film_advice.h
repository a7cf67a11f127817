#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "frontend/tracks/companions.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// What is known of a clip when its model has been made, or could not be.
struct FilmedClip {
  const TrackFile& file;
  const Reconstruction& model;            // empty: there is none
  std::string termination;                // how the reconstruction ended, as summary.json says
  const std::vector<double>& brightness;  // mean intensity of each of the file's frames, 0..1
  std::size_t features_wanted = 1000;     // that the tracker was to keep alive
  std::vector<Stretch> other_parts = {};  // of the clip, that have models of their own
};

// What the advice is drawn from.
struct ClipMeasures {
  double observed = 0.0;  // features confirmed in a frame, median over frames
  // Median over the model's points of the widest angle between their first ray and another; none
  // without points.
  std::optional<double> parallax_deg;
  // Of the observations of tracks of 10 frames and more, the share of tracks that no point of the
  // model's still world explains: the best one is off by 0.25 % of the picture's diagonal or more
  // in half of the frames. None without a model.
  std::optional<double> moving_share;
  // Mean intensity, 0..1: the 10th percentile over the frames, the median and the 90th.
  double dark = 0.0;
  double brightness = 0.0;
  double bright = 0.0;
};
ClipMeasures MeasureClip(const FilmedClip& clip);

// What made a clip hard, and how to film it better: a sentence or two each, in words that need no
// knowledge of reconstruction; empty where all went well. Never empty without a model.
std::vector<std::string> FilmAdvice(const FilmedClip& clip, const ClipMeasures& measures);

}  // namespace cohort
