#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>

#include "frontend/geometry/rigid3.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// Judges tracks without any truth: each half of the features is reconstructed by itself, and two
// halves that are right give the same camera path.

// The features in ascending order, taken in turns: first, third ... and second, fourth ...
std::array<TrackSet, 2> SplitTracks(const TrackSet& tracks);

struct HalvesAgreement {
  double frames_share = 0.0;  // of the clip's frames: those that both halves registered
  // sqrt(sum |b_i - S a_i|^2 / sum |b_i - mean b|^2) over the camera centres a_i, b_i of these
  // frames, S the similarity that makes it least: a share of the path's extent, 0 to 1, the same
  // with a and b exchanged. None where a half registered fewer than 80 % of the frames or the
  // cameras fix no alignment: a failure, not an agreement. An error that both halves share, as of
  // the camera's focal length, is not seen.
  std::optional<double> disagreement;
};

// `frames`: how many the clip has.
HalvesAgreement CompareHalves(const std::map<FrameIndex, Rigid3>& cam_from_world_a,
                              const std::map<FrameIndex, Rigid3>& cam_from_world_b,
                              std::size_t frames);

}  // namespace cohort
