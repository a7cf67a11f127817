#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "datasets/render/mip_map.h"
#include "datasets/render/scene_geometry.h"

namespace cohort {

// CV_32FC1: depth along the optical axis at the pixels' centres [m]; 0 where there is nothing. With
// a rolling shutter each row has its own camera.
cv::Mat RenderDepth(const SyntheticScene& scene, double frame);

// Renders a scene with a z-buffer, in linear light. Every pixel is the mean of nine samples, placed
// point-symmetrically about its centre, of textures filtered to the sample's footprint, so that a
// texture detail appears without bias where its surface point projects. Light and shadow are fixed
// to the surfaces, and the exposure is fixed for the clip. With a rolling shutter every row is
// rendered with camera and scene at its own time (SyntheticScene::TimeOfRow).
class Renderer {
 public:
  // Computes the textures and the light, which takes about a second. `scene` must outlive it.
  explicit Renderer(const SyntheticScene& scene, unsigned threads = 0);

  // CV_8UC1, 255 v with v = light^(1/2.2).
  cv::Mat RenderGray(double frame) const;
  // CV_32FC1: light in pixels, 1 is the brightest that RenderGray can show.
  cv::Mat RenderLight(double frame) const;

 private:
  cv::Mat LightOf(double frame, bool rolling) const;

  const SyntheticScene& scene_;
  std::vector<MipMap> textures_;  // by patch
  double exposure_ = 1.0;
};

}  // namespace cohort
