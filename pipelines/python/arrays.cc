#include "pipelines/python/arrays.h"

#include <cmath>
#include <limits>
#include <utility>

namespace py = pybind11;

namespace cohort {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

void RequireColumns(const DoubleArray& array, py::ssize_t columns, const char* what) {
  if (array.ndim() != 2 || array.shape(1) != columns) {
    ThrowError("{} must be an array (N, {})", what, columns);
  }
}

}  // namespace

void RegisterRows() {
  PYBIND11_NUMPY_DTYPE(
      ObservationRow, frame, track_id, x, y, observed, residual, cov_xx, cov_xy, cov_yy);
  PYBIND11_NUMPY_DTYPE(ViewRow, track_id, frame, x, y);
}

py::array_t<ObservationRow> ToArray(const TrackSet& tracks) {
  py::array_t<ObservationRow> array(static_cast<py::ssize_t>(tracks.observations().size()));
  ObservationRow* row = array.mutable_data();
  for (const Observation& o : tracks.observations()) {
    const PixelCovariance covariance =
        o.covariance.value_or(PixelCovariance{.xx = kNone, .xy = kNone, .yy = kNone});
    *row++ = {ToInt(o.frame),
              ToInt(o.feature),
              o.xy.x(),
              o.xy.y(),
              IsObserved(o),
              o.residual,
              covariance.xx,
              covariance.xy,
              covariance.yy};
  }
  return array;
}

TrackSet ToTracks(const py::array_t<ObservationRow>& rows) {
  if (rows.ndim() != 1) ThrowError("observations must be an array of one dimension");
  std::vector<Observation> observations(static_cast<std::size_t>(rows.shape(0)));
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const ObservationRow& row = rows.at(static_cast<py::ssize_t>(i));
    Observation& o = observations[i];
    o.feature = FeatureId{row.track_id};
    o.frame = FrameIndex{row.frame};
    o.xy = {row.x, row.y};
    o.state = row.observed ? ObservationState::kObserved : ObservationState::kPredicted;
    o.residual = row.residual;
    if (!std::isfinite(row.residual)) ThrowError("observation {}: its residual is not finite", i);
    if (std::isnan(row.cov_xx) && std::isnan(row.cov_xy) && std::isnan(row.cov_yy)) continue;
    if (!PixelCovariance::IsOne(row.cov_xx, row.cov_xy, row.cov_yy)) {
      ThrowError("observation {}: its covariance {}, {}, {} is not positive definite",
                 i,
                 row.cov_xx,
                 row.cov_xy,
                 row.cov_yy);
    }
    o.covariance = PixelCovariance{.xx = row.cov_xx, .xy = row.cov_xy, .yy = row.cov_yy};
  }
  return TrackSet::Build(std::move(observations));
}

py::array_t<double> PosesOf(const Reconstruction& model) {
  py::array_t<double> array({static_cast<py::ssize_t>(model.cam_from_world.size()),
                             static_cast<py::ssize_t>(3),
                             static_cast<py::ssize_t>(4)});
  double* at = array.mutable_data();
  for (const auto& [frame, cam_from_world] : model.cam_from_world) {
    Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(at);
    matrix.leftCols<3>() = cam_from_world.rotation.toRotationMatrix();
    matrix.col(3) = cam_from_world.translation;
    at += 12;
  }
  return array;
}

py::array_t<double> IntrinsicsOf(const Reconstruction& model) {
  py::array_t<double> array(
      {static_cast<py::ssize_t>(model.cam_from_world.size()), static_cast<py::ssize_t>(4)});
  double* at = array.mutable_data();
  for (const auto& [frame, cam_from_world] : model.cam_from_world) {
    const Camera camera = CameraOf(model, frame);
    Eigen::Map<Eigen::Vector4d>{at} = Eigen::Vector4d(camera.fx, camera.fy, camera.cx, camera.cy);
    at += 4;
  }
  return array;
}

py::array_t<double> PointsOf(const Reconstruction& model) {
  py::array_t<double> array(
      {static_cast<py::ssize_t>(model.points.size()), static_cast<py::ssize_t>(3)});
  double* at = array.mutable_data();
  for (const auto& [feature, point] : model.points) {
    Eigen::Map<Eigen::Vector3d>{at} = point.in_world;
    at += 3;
  }
  return array;
}

py::array_t<ViewRow> ViewsOf(const Reconstruction& model) {
  std::size_t count = 0;
  for (const auto& [feature, point] : model.points) count += point.views.size();
  py::array_t<ViewRow> array(static_cast<py::ssize_t>(count));
  ViewRow* row = array.mutable_data();
  for (const auto& [feature, point] : model.points) {
    for (const PointView& view : point.views) {
      *row++ = {ToInt(feature), ToInt(view.frame), view.xy.x(), view.xy.y()};
    }
  }
  return array;
}

py::array_t<double> ProjectAll(const Camera& camera, const DoubleArray& points_in_cam) {
  RequireColumns(points_in_cam, 3, "points");
  const py::ssize_t count = points_in_cam.shape(0);
  py::array_t<double> array({count, static_cast<py::ssize_t>(2)});
  const double* from = points_in_cam.data();
  double* to = array.mutable_data();
  for (py::ssize_t i = 0; i < count; ++i, from += 3, to += 2) {
    const auto xy = camera.Project(Eigen::Map<const Eigen::Vector3d>(from));
    Eigen::Map<Eigen::Vector2d>{to} = xy.value_or(Eigen::Vector2d::Constant(kNone));
  }
  return array;
}

py::array_t<double> UnprojectAll(const Camera& camera, const DoubleArray& xy) {
  RequireColumns(xy, 2, "pixels");
  const py::ssize_t count = xy.shape(0);
  py::array_t<double> array({count, static_cast<py::ssize_t>(2)});
  const double* from = xy.data();
  double* to = array.mutable_data();
  for (py::ssize_t i = 0; i < count; ++i, from += 2, to += 2) {
    Eigen::Map<Eigen::Vector2d>{to} = camera.Unproject(Eigen::Map<const Eigen::Vector2d>(from));
  }
  return array;
}

}  // namespace cohort
