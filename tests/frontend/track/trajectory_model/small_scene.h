#pragma once

#include <Eigen/Core>
#include <vector>

#include "frontend/core/random_stream.h"
#include "frontend/track/trajectory_model/state.h"

namespace cohort::test {

// A state with known cameras and coordinates of rank `rank`, and measurements of these with noise.
// The features' means are the truth, their anchors have no error and are in no frame.
struct SmallScene {
  trajectory_model::State state;
  std::vector<trajectory_model::Vector> z;
  double noise_px = 0.0;
};

inline trajectory_model::Observation Measured(const Eigen::Vector2d& xy,
                                              double noise_px,
                                              RandomStream& random) {
  trajectory_model::Observation o;
  o.xy = xy + noise_px * Eigen::Vector2d(random.Gaussian(), random.Gaussian());
  o.information = Eigen::Matrix2d::Identity() / (noise_px * noise_px);
  return o;
}

inline trajectory_model::Camera MovingCamera(int frame, int rank, bool perspective) {
  trajectory_model::Camera camera = trajectory_model::Camera::Zero(3, rank + 1);
  camera.topLeftCorner<3, 3>() << 320.0 + 4.0 * frame, 150.0, 2.0,  //
      240.0 - 3.0 * frame, -1.0, 110.0,                             //
      1.0, 0.0, 0.0;
  if (rank > 2) camera.col(3) << 5.0 * frame, 2.0 * frame, perspective ? 0.02 * frame : 0.0;
  return camera;
}

inline SmallScene MakeSmallScene(
    int features, int frames, int rank, bool perspective, double noise_px, std::uint64_t seed = 1) {
  RandomStream random(seed, "test/small_scene");
  SmallScene scene;
  scene.noise_px = noise_px;
  scene.state.perspective = perspective;
  scene.state.rank = rank;
  for (int f = 0; f < features; ++f) {
    trajectory_model::Vector z(rank);
    for (double& entry : z) entry = random.Uniform(-1.7, 1.7);  // variance 1
    trajectory_model::FeaturePosterior feature;
    feature.mean = trajectory_model::Vector::Zero(rank + 2);
    feature.mean.head(rank) = z;
    feature.covariance = 1e-4 * trajectory_model::Matrix::Identity(rank + 2, rank + 2);
    scene.state.features.push_back(feature);
    scene.z.push_back(z);
  }
  for (int t = 0; t < frames; ++t) {
    trajectory_model::Frame frame;
    frame.camera = MovingCamera(t, rank, perspective);
    for (const trajectory_model::Vector& z : scene.z) {
      frame.observations.push_back(
          Measured(trajectory_model::Project(frame.camera, z).xy, noise_px, random));
    }
    scene.state.frames.push_front(frame);
  }
  return scene;
}

}  // namespace cohort::test
