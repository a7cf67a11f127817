#pragma once

#include <vector>

#include "backend/scene/whitened_tracks.h"

namespace cohort {

// What two frames of a clip share.
struct FramePairMotion {
  int frame_a = 0;
  int frame_b = 0;
  int common = 0;          // tracks seen by both
  double motion_px = 0.0;  // median displacement
  // Median of the displacement that remains after the best rotation about the camera's centre:
  // parallax and noise.
  double parallax_px = 0.0;
};
FramePairMotion MeasureMotion(const WhitenedTracks& whitened,
                              const Camera& camera,
                              int frame_a,
                              int frame_b);

// Selects a new keyframe after a parallax of `parallax_px` since the last one, or when 30 % of its
// tracks are gone. The threshold is halved (down to 1 px) until there are `at_least` keyframes. A
// frame that shares too few tracks with the last keyframe becomes a keyframe as well.
std::vector<int> SelectKeyframes(const WhitenedTracks& whitened,
                                 const Camera& camera,
                                 double parallax_px = 10.0,  // tuned on the tuning clips
                                 int at_least = 10);

// The fewest tracks that two frames must share: more than twice the five of an essential matrix.
inline constexpr int kMinCommonTracks = 12;

// Pairs of keyframes that share at least 30 % of their tracks (and kMinCommonTracks), ranked as
// starts by common * min(1, parallax / good_parallax), best first.
std::vector<FramePairMotion> RankPairs(const WhitenedTracks& whitened,
                                       const Camera& camera,
                                       const std::vector<int>& keyframes);

}  // namespace cohort
