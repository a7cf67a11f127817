#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "backend/adjust/working_model.h"
#include "backend/scene/keyframes.h"

namespace cohort {

// Standard deviation of an observation's coordinate [px], from the second differences of tracks
// over three frames without the affine motion that all tracks of a frame share. It is an upper
// bound if the camera shakes and depths differ. Repeated pictures do not count; 0 if nothing is
// left.
double EstimateNoise(const WhitenedTracks& whitened);

// The camera itself if it is known, else cameras with focal lengths from half to twice the guess.
std::vector<Camera> CamerasToTry(const Camera& camera);

// The pairs of frames with the largest motion, with the positions of their common tracks.
using Correspondences = std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>>;
struct WidestPairs {
  std::vector<Correspondences> pairs;
  double motion_px = 0.0;  // median displacement of the first pair
  // The share of a pair's tracks that a rotation has to explain: half of all tracks, since many may
  // be outliers, and nine tenths of a model's inliers, since a near object in front of a wall may
  // be small.
  double quantile = 0.5;
};
WidestPairs WidestPairsOf(const WhitenedTracks& whitened, std::vector<FramePairMotion> pairs);
// The same for the model's inliers only.
WidestPairs WidestPairsOf(const WorkingModel& model, std::vector<FramePairMotion> pairs);

enum class ClipMotion { kParallax, kRotation, kStatic };
// Whether any of these pairs shows parallax beyond the noise. If the camera is a guess, its focal
// length is varied from half to twice, so that no wrong guess makes a rotation look like parallax.
ClipMotion ClassifyMotion(const WidestPairs& widest, const Camera& camera, double noise_px);

// Whether these pairs show parallax according to ClassifyMotion, but none for a camera whose focal
// length and k1 are near those that it tried. Either the effect of the lens is mistaken for depth,
// or the camera moves so little that the lens explains the motion as well.
bool TurnsByAnotherCamera(const WidestPairs& widest, const Camera& camera, double noise_px);

// Classifies the motion of a clip that gave no model, by the direction of the residuals of the best
// rotation: parallax lies along the epipolar lines, whereas drifting tracks and moving objects
// leave as much across them. A drift of s px per coordinate leaves a median of 1.67 s after the
// best rotation and of 0.67 s across the epipolar lines, a ratio of 2.5 (3 to 4 if few tracks fit
// their own essential matrix); cameras that moved have 8 or more. `pairs` are those of RankPairs.
ClipMotion ClassifyDrift(const WhitenedTracks& whitened,
                         const Camera& camera,
                         const std::vector<FramePairMotion>& pairs);

}  // namespace cohort
