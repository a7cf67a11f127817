#pragma once

#include <cstdint>
#include <vector>

#include "backend/adjust/working_model.h"
#include "backend/scene/keyframes.h"
#include "frontend/core/options.h"

namespace cohort {

enum class StartMethod : std::uint8_t { kEssential, kHomography, kAffine };
inline constexpr ChoiceNames<StartMethod, 3> kStartMethodNames{
    {{"essential matrix", StartMethod::kEssential},
     {"homography", StartMethod::kHomography},
     {"affine factorisation", StartMethod::kAffine}}};

// A model of a window of frames, adjusted, and its truncated cost over the window.
struct StartModel {
  WorkingModel model;
  StartMethod method = StartMethod::kEssential;
  double cost = 0.0;
  std::vector<int> window;
};

// Models of the frames from pair.frame_a to pair.frame_b, the best first: relative poses of the
// essential matrix and, if a homography explains the pair too, of its decomposition, and both
// mirror models of the affine factorisation. All are grown over the window, adjusted there and
// compared by cost; models that leave half of the window unexplained are dropped.
std::vector<StartModel> BuildStartModels(const WhitenedTracks& whitened,
                                         const Camera& camera,
                                         const FramePairMotion& pair);

}  // namespace cohort
