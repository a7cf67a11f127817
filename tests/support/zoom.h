#pragma once

#include <cmath>

#include "backend/scene/focal_scale.h"
#include "backend/scene/reconstruction.h"
#include "tests/support/synthetic_tracks.h"

namespace cohort::test {

// A zoom of a factor of two over a clip, at one rate.
inline FocalScales ZoomOf(const std::vector<FrameInfo>& frames) {
  FocalScales scales;
  const auto last = static_cast<double>(frames.size() - 1);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    scales[frames[i].index] = std::pow(2.0, static_cast<double>(i) / last - 0.5);
  }
  return scales;
}

// The scene as a camera sees it that zooms; positions may lie beside the picture.
inline SyntheticTracks Zoomed(SyntheticTracks scene, const FocalScales& scales) {
  FocalScales back;
  for (const auto& [frame, scale] : scales) back[frame] = 1.0 / scale;
  scene.file.tracks = AtOneFocalLength(scene.file.tracks, *scene.file.camera, back);
  return scene;
}

// The truth of a scene as a model.
inline Reconstruction ModelOfTruth(const SyntheticTracks& scene, const FocalScales& scales = {}) {
  Reconstruction model;
  model.camera = *scene.file.camera;
  model.focal_scale = scales;
  model.cam_from_world = scene.cam_from_world;
  for (const Observation& o : scene.file.tracks.observations()) {
    Point3D& point = model.points[o.feature];
    point.in_world = scene.points_in_world.at(o.feature);
    point.views.push_back({o.frame, o.xy});
  }
  return model;
}

}  // namespace cohort::test
