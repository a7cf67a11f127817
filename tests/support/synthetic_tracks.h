#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <utility>

#include "frontend/geometry/camera.h"
#include "frontend/geometry/rigid3.h"
#include "frontend/tracks/track_store.h"

namespace cohort::test {

enum class CameraPath {
  kArc,       // 40 degrees around a box of points, looking at its middle
  kLateral,   // sideways past points 4 to 9 away
  kForward,   // into a room 4 to 14 deep
  kRotation,  // turning on the spot
  kStatic,
};

struct SyntheticTracksOptions {
  CameraPath path = CameraPath::kArc;
  int frames = 24;
  double path_length = 1.0;  // kLateral: a path, and a scene beside it, that much longer
  int points = 300;
  double noise_px = 0.3;          // a coordinate
  double drift_px = 0.0;          // of a coordinate from frame to frame, a random walk
  double outlier_fraction = 0.0;  // of the observations: somewhere else in the image
  double missing_fraction = 0.0;  // of the observations: left out
  int max_track_length = 0;       // 0: as long as it is in the image
  double plane_relief = 1.0;      // depth of the scene off its middle plane; 0: a plane
  double height = 1.0;            // of the scene, relative; 0 of a plane: a line
  std::uint32_t first_frame = 0;  // source index of the first frame
  std::uint32_t frame_stride = 1;
  Camera camera = DefaultCamera();
  std::uint64_t seed = 1;

  static Camera DefaultCamera();  // 640x480, f = 500
};

// Tracks of a known scene and its truth. Feature ids have gaps: an id is no index.
struct SyntheticTracks {
  TrackFile file;
  std::map<FrameIndex, Rigid3> cam_from_world;
  std::map<FeatureId, Eigen::Vector3d> points_in_world;
  std::set<std::pair<FeatureId, FrameIndex>> outliers;
};

SyntheticTracks MakeSyntheticTracks(const SyntheticTracksOptions& options = {});

// RMS distance of camera centres after the best similarity (Umeyama); all of `estimate`'s frames
// must have truth.
double AbsoluteTrajectoryError(const std::map<FrameIndex, Rigid3>& estimate_cam_from_world,
                               const std::map<FrameIndex, Rigid3>& true_cam_from_world);

}  // namespace cohort::test
