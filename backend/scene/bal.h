#pragma once

#include <filesystem>

#include "backend/scene/reconstruction.h"

namespace cohort {

// Writes a problem of "Bundle Adjustment in the Large", the text format of Ceres' bundle_adjuster
// and most other solvers: `cameras points observations`, then a line `camera point x y` per
// observation, then the nine numbers of every camera (Rodrigues vector, t, f, k1, k2) and the three
// of every point, one per line. Cameras and points are in the order of frames and features. The
// camera looks along -z, x points right and y up, and the origin is the principal point:
//   P = R X + t,  p = -(Px, Py) / Pz,  (x, y) = f (1 + k1 |p|^2 + k2 |p|^4) p.
// BAL has only one focal length, k1 and k2. If the camera has more parameters or is a fisheye, the
// observations are written undistorted, with f = fx. BAL has no rolling shutter either: move such
// views to their global-shutter positions first (AsGlobalShutter and MoveViewsToTracks), since they
// are written unchanged. The file is written whole or not at all.
void WriteBal(const std::filesystem::path& path, const Reconstruction& reconstruction);

}  // namespace cohort
