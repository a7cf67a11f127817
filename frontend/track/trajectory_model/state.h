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
  double misfit = 1.0;  // MisfitOfFrame, when it was last computed
};

// All that the model knows: a window of frames, and the features that are in it.
struct State {
  bool perspective = true;   // else c = 0 in every camera
  int rank = 0;              // r; 0: there were too few features so far
  std::deque<Frame> frames;  // newest first
  std::vector<Feature> features;
};

// By how much the squares of a frame's residuals exceed what their noise explains: their median
// over that of chi-square, at least 1.
double MisfitOfFrame(const Frame& frame, std::span<const Feature> features);

// The same of a feature in all frames: chi-square over its degrees of freedom, two a measurement
// without the r that its coordinates take; drawn to 1 where these are few.
double MisfitOfFeature(const State& state, std::size_t f);

// Frames in which a feature was observed, without that of its anchor.
std::size_t CountObserved(const State& state, std::size_t f);

}  // namespace cohort::trajectory_model
