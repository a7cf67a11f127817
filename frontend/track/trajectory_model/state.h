#pragma once

#include <cstddef>
#include <deque>
#include <span>
#include <vector>

#include "frontend/track/trajectory_model/observation.h"
#include "frontend/track/trajectory_model/projection.h"

namespace cohort::trajectory_model {

struct Frame {
  std::vector<Observation> observations;  // of all features, in their order
  Camera camera;
  double misfit = 1.0;  // MisfitOfFrame when last computed
};

// The state of the model: a window of frames, and the features in it.
struct State {
  bool perspective = true;   // else c = 0 in every camera
  int rank = 0;              // r; 0: too few features so far
  std::deque<Frame> frames;  // newest first
  std::vector<FeaturePosterior> features;
};

// The factor by which the squares of a frame's residuals exceed what their noise explains: their
// median over that of chi-square, at least 1.
double MisfitOfFrame(const Frame& frame, std::span<const FeaturePosterior> features);

// The same of a feature in all frames: chi-square over its degrees of freedom, which are two per
// measurement minus the r of its coordinates. Shrunk towards 1 if these are few.
double MisfitOfFeature(const State& state, std::size_t f);

// The number of frames that observe a feature, without the frame of its anchor.
std::size_t CountObserved(const State& state, std::size_t f);

}  // namespace cohort::trajectory_model
