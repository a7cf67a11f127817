#include "frontend/track/measure/feature.h"

#include <algorithm>

namespace cohort {

MeasuredFeature TakeFeature(const Pyramid& smooth,
                            const Eigen::Vector2d& xy,
                            const PatchOptions& patch) {
  MeasuredFeature feature;
  feature.window_px = std::max(patch.window_px, patch.wide_window_px);
  feature.anchor = TakeAnchor(smooth, xy, patch.window_px, feature.window_px);
  return feature;
}

}  // namespace cohort
