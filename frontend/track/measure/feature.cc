#include "frontend/track/measure/feature.h"

#include <algorithm>
#include <utility>

#include "frontend/image/sampling.h"

namespace cohort {

Templates TakeTemplates(const Pyramid& pyramid, const Eigen::Vector2d& xy, int n) {
  Templates templates;
  double scale = 1.0;
  for (const cv::Mat& level : pyramid.levels) {
    std::vector<float> patch(static_cast<std::size_t>(n) * n);
    SamplePatch(level, xy.x() * scale, xy.y() * scale, n, patch.data());
    templates.push_back(std::move(patch));
    scale *= 0.5;
  }
  return templates;
}

Feature TakeFeature(const Pyramid& picture,
                    const Pyramid& smooth,
                    const Eigen::Vector2d& xy,
                    int template_px,
                    const PatchOptions& patch) {
  Feature feature;
  feature.templates = TakeTemplates(picture, xy, template_px);
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
