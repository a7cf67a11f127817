#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>

#include "frontend/geometry/rigid3.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// Evaluates tracks without ground truth: each half of the features is reconstructed separately, and
// two correct halves give the same camera path.

// Alternate features in ascending order: first, third ... and second, fourth ...
std::array<TrackSet, 2> SplitTracks(const TrackSet& tracks);

struct HalvesAgreement {
  double frames_share = 0.0;  // of the clip's frames: those that both halves registered
  // sqrt(sum |b_i - S a_i|^2 / sum |b_i - mean b|^2) over the camera centres a_i, b_i of these
  // frames, with S the similarity that minimises it: a share of the path's extent, 0 to 1,
  // symmetric in a and b. Unset if a half registered fewer than 80 % of the frames or the cameras
  // determine no alignment, which is a failure, not an agreement. Errors that both halves share,
  // such as that of the focal length, do not show.
  std::optional<double> disagreement;
};

// `frames`: the number of frames of the clip.
HalvesAgreement CompareHalves(const std::map<FrameIndex, Rigid3>& cam_from_world_a,
                              const std::map<FrameIndex, Rigid3>& cam_from_world_b,
                              std::size_t frames);

}  // namespace cohort
