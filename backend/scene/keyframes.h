#pragma once

#include <optional>
#include <vector>

#include "backend/scene/whitened_tracks.h"

namespace cohort {

// What two frames of a clip share.
struct FramePairMotion {
  int frame_a = 0;
  int frame_b = 0;
  int common = 0;          // tracks seen by both
  double motion_px = 0.0;  // median displacement
  // Median of what remains of it after the best rotation about the camera's centre: parallax, and
  // noise.
  double parallax_px = 0.0;
};
FramePairMotion MeasureMotion(const WhitenedTracks& whitened,
                              const Camera& camera,
                              int frame_a,
                              int frame_b);

// Frames at which something new is to be seen: a parallax of `parallax_px` since the last one, or
// 30 % of its tracks gone. The threshold is halved (down to 1 px) until there are `at_least` of
// them. A frame too poor in tracks to be tied to the last one starts anew.
std::vector<int> SelectKeyframes(const WhitenedTracks& whitened,
                                 const Camera& camera,
                                 double parallax_px,
                                 int at_least);

// Pairs of keyframes that share at least 30 % of their tracks (and min_common), by how good a start
// they give: common * min(1, parallax / good_parallax), best first.
std::vector<FramePairMotion> RankPairs(const WhitenedTracks& whitened,
                                       const Camera& camera,
                                       const std::vector<int>& keyframes,
                                       int min_common);

// Standard deviation of an observation's coordinate [px], from the second differences of tracks
// over three frames less the median of all in the frame: an upper bound where the camera shakes.
double EstimateNoise(const WhitenedTracks& whitened);

// The camera itself if it is known, else with focal lengths from half to twice its guess.
std::vector<Camera> CamerasToTry(const Camera& camera);

enum class ClipMotion { kParallax, kRotation, kStatic };
// Whether any of these pairs shows parallax beyond the noise. Where the camera is a guess, its
// focal length is varied from half to twice, so that no wrong guess passes a turning camera off as
// moving.
ClipMotion ClassifyMotion(const WhitenedTracks& whitened,
                          const Camera& camera,
                          const std::vector<FramePairMotion>& pairs,
                          double noise_px);

// The same of a clip that gave no model, by the direction of what a rotation leaves: parallax lies
// along the epipolar lines, drift of the tracks and things that move as much across them. A drift
// of s px a coordinate leaves a median of 1.67 s after the best rotation and of 0.67 s across the
// epipolar lines, a ratio of 2.5 (3 to 4 where few tracks fit their own essential matrix); cameras
// that moved have 8 and more. `pairs` as RankPairs gives them.
ClipMotion ClassifyDrift(const WhitenedTracks& whitened,
                         const Camera& camera,
                         const std::vector<FramePairMotion>& pairs);

}  // namespace cohort
