#include "frontend/track/measure/feature.h"

#include <algorithm>
#include <utility>

namespace cohort {

Feature TakeFeature(const Pyramid& smooth, const Eigen::Vector2d& xy, const PatchOptions& patch) {
  Feature feature;
  feature.window_px = std::max(patch.window_px, patch.wide_window_px);
  feature.anchor = TakeAnchor(smooth, xy, patch.window_px, feature.window_px);
  return feature;
}

void KeepFeatures(std::span<const std::uint8_t> keep, std::vector<Feature>& features) {
  std::size_t kept = 0;
  for (std::size_t f = 0; f < keep.size(); ++f) {
    if (keep[f] == 0) continue;
    if (kept != f) features[kept] = std::move(features[f]);
    ++kept;
  }
  features.resize(kept);
}

}  // namespace cohort
