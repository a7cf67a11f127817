#pragma once

#include <vector>

#include "backend/scene/keyframes.h"

namespace cohort {

// Standard deviation of an observation's coordinate [px], from the second differences of tracks
// over three frames less the affine motion that all in the frame share: an upper bound where the
// camera shakes before depths that differ. Pictures that are repeated do not count; 0 where nothing is
// left.
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

// Whether these pairs show parallax by ClassifyMotion, but none for a camera of another focal length
// and k1, near those that it tried: what a lens does is taken for depth then. Or the camera goes so
// little way that this explains it as well.
bool TurnsByAnotherCamera(const WhitenedTracks& whitened,
                          const Camera& camera,
                          const std::vector<FramePairMotion>& pairs,
                          double noise_px);

// What ClassifyMotion says of a clip that gave no model, by the direction of what a rotation
// leaves: parallax lies along the epipolar lines, drift of the tracks and things that move as much
// across them. A drift of s px a coordinate leaves a median of 1.67 s after the best rotation and
// of 0.67 s across the epipolar lines, a ratio of 2.5 (3 to 4 where few tracks fit their own
// essential matrix); cameras that moved have 8 and more. `pairs` as RankPairs gives them.
ClipMotion ClassifyDrift(const WhitenedTracks& whitened,
                         const Camera& camera,
                         const std::vector<FramePairMotion>& pairs);

}  // namespace cohort
