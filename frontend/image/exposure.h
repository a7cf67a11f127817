#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>

#include "frontend/image/frame.h"
#include "frontend/image/pyramid.h"

namespace cohort {

// How the light of a picture differs from another's: I = gain * I_other + offset.
struct LightChange {
  double gain = 1.0;
  double offset = 0.0;  // intensities 0..1
};

// Brings all frames of a clip to the light of the first one that shows anything: automatic exposure
// and lamps change gain and offset of whole frames, and neither templates nor their noise know of
// it. Estimated against the newest picture that set the light, so that slow changes add up to
// something and small errors do not; where too little of that one is in view any more, against the
// last picture. A small change is none, so that a clip in steady light keeps its bytes.
class Exposure {
 public:
  // The light of the clip's next picture, against the first one's. A picture that shows nothing,
  // or nothing of the last ones, is taken to be in the same light as before.
  const LightChange& Follow(const cv::Mat& gray);

 private:
  struct Seen {
    Pyramid picture;  // as it came
    LightChange light;
  };
  std::optional<LightChange> LightOf(const Pyramid& picture);

  LightChange light_;
  std::optional<Seen> reference_;
  std::optional<Seen> last_;
};

// The picture as the light would show it that `light` is measured against: CV_32FC1, or `gray`
// itself where there is no difference.
cv::Mat WithoutLight(const cv::Mat& gray, const LightChange& light);
// The frame with that picture, and the step of what it was in that light.
Frame WithoutLight(Frame frame, const LightChange& light);

// Of `current` against `previous`, where their coarsest levels overlap after registration, by the
// reduced major axis (both are noisy: the gain is the ratio of the standard deviations; Ricker,
// 1973), without the pixels that fit least or are black or saturated. None where the rest is too
// little or too unlike (correlation under 0.95).
std::optional<LightChange> EstimateLightChange(const Pyramid& previous, const Pyramid& current);

}  // namespace cohort
