#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>

#include "frontend/image/pyramid.h"

namespace cohort {

// How the light of a picture differs from another's: I = gain * I_other + offset.
struct LightChange {
  double gain = 1.0;
  double offset = 0.0;  // intensities 0..1
};

// Brings all frames of a clip to the light of the first one that shows anything: automatic exposure and lamps change gain and
// offset of whole frames, and neither templates nor their noise know of it. Between neighbours both
// are estimated where their coarsest levels overlap after registration, by the regression that takes
// both for noisy (gain: ratio of the standard deviations), without the pixels that fit least or are
// black or saturated. A small change is none, so that a clip in steady light keeps its bytes.
class Exposure {
 public:
  // The light of the clip's next picture, against the first one's.
  const LightChange& Follow(const cv::Mat& gray);

 private:
  LightChange light_;
  std::optional<Pyramid> previous_;  // as it came
};

// The picture as the light would show it that `light` is measured against: CV_32FC1, or `gray` itself
// where there is no difference.
cv::Mat WithoutLight(const cv::Mat& gray, const LightChange& light);

// Of `current` against `previous`; none where they have too little in common to say.
std::optional<LightChange> EstimateLightChange(const Pyramid& previous, const Pyramid& current);

}  // namespace cohort
