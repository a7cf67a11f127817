#pragma once

#include <map>
#include <numeric>
#include <vector>

#include "backend/adjust/working_model.h"
#include "tests/support/synthetic_tracks.h"

namespace cohort::test {

inline SyntheticTracks LateralScene(double noise_px = 0.3) {
  SyntheticTracksOptions options;
  options.path = CameraPath::kLateral;
  options.noise_px = noise_px;
  return MakeSyntheticTracks(options);
}

// The true poses of these frames, and points from them.
inline WorkingModel TrueModel(const SyntheticTracks& scene,
                              const WhitenedTracks& whitened,
                              const std::vector<int>& frames) {
  WorkingModel model(whitened, *scene.file.camera);
  for (const int f : frames) {
    model.SetPose(f, scene.cam_from_world.at(whitened.frames()[f].index));
  }
  model.TriangulateAllTracks();
  return model;
}

inline std::vector<int> AllFrames(const WhitenedTracks& whitened) {
  std::vector<int> frames(whitened.frame_count());
  std::iota(frames.begin(), frames.end(), 0);
  return frames;
}

inline double Ate(const WorkingModel& model, const SyntheticTracks& scene) {
  std::map<FrameIndex, Rigid3> poses;
  for (const int f : model.RegisteredFrames()) {
    poses[model.whitened().frames()[f].index] = model.Pose(f);
  }
  return AbsoluteTrajectoryError(poses, scene.cam_from_world);
}

}  // namespace cohort::test
