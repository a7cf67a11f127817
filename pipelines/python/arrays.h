#pragma once

#include <pybind11/numpy.h>

#include <cstdint>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "frontend/geometry/camera.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// A row of the array of observations; NaN covariances mean none. docs/python.md lists the columns.
struct ObservationRow {
  std::uint32_t frame;
  std::uint32_t track_id;
  double x;
  double y;
  bool observed;
  double residual;
  float cov_xx;
  float cov_xy;
  float cov_yy;
};
struct ViewRow {
  std::uint32_t track_id;
  std::uint32_t frame;
  double x;
  double y;
};
// Registers both with NumPy; call it once, before any use.
void RegisterRows();

pybind11::array_t<ObservationRow> ToArray(const TrackSet& tracks);
// Throws Error naming an invalid row.
TrackSet ToTracks(const pybind11::array_t<ObservationRow>& rows);

pybind11::array_t<double> PosesOf(const Reconstruction& model);       // (R, 3, 4), cam_from_world
pybind11::array_t<double> IntrinsicsOf(const Reconstruction& model);  // (R, 4) fx, fy, cx, cy
pybind11::array_t<double> PointsOf(const Reconstruction& model);      // (P, 3), in the world
pybind11::array_t<ViewRow> ViewsOf(const Reconstruction& model);

// Projects (N, 3) in the camera's frame to (N, 2) [px], NaN at or behind the camera; and unprojects
// pixels (N, 2) to normalised image points (N, 2).
using DoubleArray =
    pybind11::array_t<double, pybind11::array::c_style | pybind11::array::forcecast>;
pybind11::array_t<double> ProjectAll(const Camera& camera, const DoubleArray& points_in_cam);
pybind11::array_t<double> UnprojectAll(const Camera& camera, const DoubleArray& xy);

}  // namespace cohort
