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

  bool IsNone() const { return gain == 1.0 && offset == 0.0; }
};

// Brings all frames of a clip to the light of the first one that shows anything. Automatic exposure
// and lamps change gain and offset of whole frames, which neither templates nor their noise model
// account for. The change is estimated against a reference picture, so that slow changes accumulate
// and small errors do not. If too little of the reference is still in view, the last picture
// becomes the reference. Small changes are ignored, so that a clip in steady light keeps its bytes.
class Exposure {
 public:
  // The light of the clip's next picture, relative to the first one's. A picture that shows
  // nothing, or nothing of the last ones, is taken to have the same light as before.
  const LightChange& Follow(const cv::Mat& gray);
  // The same for callers that have its BuildPyramid already.
  const LightChange& Follow(const Pyramid& picture);

 private:
  struct Seen {
    Pyramid picture;  // as decoded
    LightChange light;
  };
  std::optional<LightChange> LightOf(const Pyramid& picture);

  LightChange light_;
  std::optional<Seen> reference_;
  std::optional<Seen> last_;
};

// The picture in the light that `light` is measured against: CV_32FC1, or `gray` itself if there is
// no difference.
cv::Mat WithoutLight(const cv::Mat& gray, const LightChange& light);
// The frame with that picture, and its intensity step in that light.
Frame WithoutLight(Frame frame, const LightChange& light);

// The light of `current` relative to `previous`, where their coarsest levels overlap after
// registration, by the reduced major axis (both are noisy: the gain is the ratio of the standard
// deviations; Ricker, 1973), without the worst-fitting, black or saturated pixels. Returns nullopt
// if too few pixels remain or they differ too much (correlation under 0.95).
std::optional<LightChange> EstimateLightChange(const Pyramid& previous, const Pyramid& current);

}  // namespace cohort
