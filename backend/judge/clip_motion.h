#pragma once

#include <Eigen/Core>
#include <utility>
#include <vector>

#include "backend/adjust/working_model.h"
#include "backend/scene/keyframes.h"

namespace cohort {

// Standard deviation of an observation's coordinate [px], from the second differences of tracks
// over three frames less the affine motion that all in the frame share: an upper bound where the
// camera shakes before depths that differ. Pictures that are repeated do not count; 0 where nothing is
// left.
double EstimateNoise(const WhitenedTracks& whitened);

// The camera itself if it is known, else with focal lengths from half to twice its guess.
std::vector<Camera> CamerasToTry(const Camera& camera);

// Where tracks are in the two frames of each of those pairs that move most.
using Correspondences = std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>>;
struct WidestPairs {
  std::vector<Correspondences> pairs;
  double motion_px = 0.0;  // median displacement of the first pair
  // The share of a pair's tracks that a rotation has to explain: half of tracks of which many may be
  // wrong, nine tenths of a model's inliers, since a near thing may be small before a wall.
  double quantile = 0.5;
};
WidestPairs WidestPairsOf(const WhitenedTracks& whitened, std::vector<FramePairMotion> pairs);
// Of the model's inliers.
WidestPairs WidestPairsOf(const WorkingModel& model, std::vector<FramePairMotion> pairs);

enum class ClipMotion { kParallax, kRotation, kStatic };
// Whether any of these pairs shows parallax beyond the noise. Where the camera is a guess, its
// focal length is varied from half to twice, so that no wrong guess passes a turning camera off as
// moving.
ClipMotion ClassifyMotion(const WidestPairs& widest, const Camera& camera, double noise_px);

// Whether these pairs show parallax by ClassifyMotion, but none for a camera of another focal length
// and k1, near those that it tried: what a lens does is taken for depth then. Or the camera goes so
// little way that this explains it as well.
bool TurnsByAnotherCamera(const WidestPairs& widest, const Camera& camera, double noise_px);

// What ClassifyMotion says of a clip that gave no model, by the direction of what a rotation
// leaves: parallax lies along the epipolar lines, drift of the tracks and things that move as much
// across them. A drift of s px a coordinate leaves a median of 1.67 s after the best rotation and
// of 0.67 s across the epipolar lines, a ratio of 2.5 (3 to 4 where few tracks fit their own
// essential matrix); cameras that moved have 8 and more. `pairs` as RankPairs gives them.
ClipMotion ClassifyDrift(const WhitenedTracks& whitened,
                         const Camera& camera,
                         const std::vector<FramePairMotion>& pairs);

}  // namespace cohort
