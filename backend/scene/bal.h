#pragma once

#include <filesystem>

#include "backend/scene/reconstruction.h"

namespace cohort {

// A problem of "Bundle Adjustment in the Large", the text that Ceres' bundle_adjuster and most
// other solvers read: `cameras points observations`, then a line `camera point x y` an observation,
// then the nine numbers of every camera (Rodrigues vector, t, f, k1, k2) and the three of every
// point, one a line. Cameras and points are in the order of frames and features. The camera looks
// along -z, x is to the right and y up, the origin is the principal point:
//   P = R X + t,  p = -(Px, Py) / Pz,  (x, y) = f (1 + k1 |p|^2 + k2 |p|^4) p.
// BAL has one focal length, k1 and k2 only: where the camera has more, or is a fisheye, the
// observations are written undistorted, and f = fx. Nor does it know of a rolling shutter: views of
// one are to be moved to where a global one would have seen them first (AsGlobalShutter and
// MoveViewsToTracks), for here they are written as they are. Whole or not at all.
void WriteBal(const std::filesystem::path& path, const Reconstruction& reconstruction);

}  // namespace cohort
