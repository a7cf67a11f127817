#include "backend/colmap/camera_model.h"

#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

#include "frontend/core/error.h"
#include "frontend/geometry/camera_fault.h"

namespace cohort {
namespace {

using Coefficients = std::vector<double Camera::*>;

struct ModelRow {
  ColmapCameraModel colmap;
  const char* name;
  CameraModel model;
  bool two_focals;
  Coefficients coefficients;  // in COLMAP's order, after the focal lengths and cx, cy

  std::size_t Parameters() const { return (two_focals ? 4 : 3) + coefficients.size(); }
};

const std::array<ModelRow, 9>& Rows() {
  using C = Camera;
  using M = ColmapCameraModel;
  constexpr auto kPinhole = CameraModel::kPinhole;
  constexpr auto kFisheye = CameraModel::kFisheye;
  static const Coefficients full{&C::k1, &C::k2, &C::p1, &C::p2, &C::k3, &C::k4, &C::k5, &C::k6};
  static const std::array<ModelRow, 9> rows{{
      {M::kSimplePinhole, "SIMPLE_PINHOLE", kPinhole, false, {}},
      {M::kPinhole, "PINHOLE", kPinhole, true, {}},
      {M::kSimpleRadial, "SIMPLE_RADIAL", kPinhole, false, {&C::k1}},
      {M::kRadial, "RADIAL", kPinhole, false, {&C::k1, &C::k2}},
      {M::kOpencv, "OPENCV", kPinhole, true, {&C::k1, &C::k2, &C::p1, &C::p2}},
      {M::kOpencvFisheye, "OPENCV_FISHEYE", kFisheye, true, {&C::k1, &C::k2, &C::k3, &C::k4}},
      {M::kFullOpencv, "FULL_OPENCV", kPinhole, true, full},
      {M::kSimpleRadialFisheye, "SIMPLE_RADIAL_FISHEYE", kFisheye, false, {&C::k1}},
      {M::kRadialFisheye, "RADIAL_FISHEYE", kFisheye, false, {&C::k1, &C::k2}},
  }};
  return rows;
}

[[noreturn]] void ThrowUnsupported(const std::string& model) {
  std::vector<const char*> names;
  for (const ModelRow& row : Rows()) names.push_back(row.name);
  ThrowError(
      "COLMAP camera model {} is not supported: use one of {}", model, fmt::join(names, ", "));
}

const ModelRow& Row(ColmapCameraModel model) {
  for (const ModelRow& row : Rows()) {
    if (row.colmap == model) return row;
  }
  ThrowUnsupported(fmt::format("{}", static_cast<int>(model)));
}

// COLMAP refines every parameter of a guessed camera's model. If possible, the model therefore has
// no more than those that the Ceres backend refines, one focal length and two radial coefficients.
// This is always possible for a guess of our own; one from a file may have two focal lengths, p1
// and p2, or be a fisheye.
ColmapCameraModel SmallestModel(const Camera& camera) {
  if (camera.model == CameraModel::kFisheye) return ColmapCameraModel::kOpencvFisheye;
  if (!camera.HasAtMostFourCoefficients()) return ColmapCameraModel::kFullOpencv;
  if (!camera.known && camera.fx == camera.fy && camera.p1 == 0.0 && camera.p2 == 0.0) {
    return camera.k2 == 0.0 ? ColmapCameraModel::kSimpleRadial : ColmapCameraModel::kRadial;
  }
  return camera.HasDistortion() ? ColmapCameraModel::kOpencv : ColmapCameraModel::kPinhole;
}

ColmapCamera Written(const Camera& camera, const ModelRow& row) {
  ColmapCamera result;
  result.model = row.colmap;
  result.width_px = camera.width_px;
  result.height_px = camera.height_px;
  result.prior_focal_length = camera.known;
  if (row.two_focals) {
    result.params = {camera.fx, camera.fy};
  } else {
    result.params = {0.5 * (camera.fx + camera.fy)};
  }
  result.params.push_back(camera.cx + kColmapPixelShift);
  result.params.push_back(camera.cy + kColmapPixelShift);
  for (const auto coefficient : row.coefficients) result.params.push_back(camera.*coefficient);
  return result;
}

// Whether the model has a parameter for everything that the camera has.
bool Holds(const ModelRow& row, const Camera& camera) {
  if (row.model != camera.model || (!row.two_focals && camera.fx != camera.fy)) return false;
  Camera rest = camera;
  for (const auto coefficient : row.coefficients) rest.*coefficient = 0.0;
  rest.model = CameraModel::kPinhole;  // a fisheye has distortion without coefficients
  return !rest.HasDistortion();
}

bool AreEqualButForRounding(const ColmapCamera& a, const ColmapCamera& b) {
  constexpr double kRounding = 1e-9;
  const auto is_near = [](double x, double y) {
    return std::abs(x - y) <= kRounding * std::abs(y);
  };
  return a.model == b.model && a.width_px == b.width_px && a.height_px == b.height_px &&
         std::ranges::equal(a.params, b.params, is_near);
}

}  // namespace

bool IsStartOfColmap(const ColmapCamera& camera) {
  const std::vector<double>& params = camera.params;
  return Row(camera.model).two_focals && !Row(camera.model).coefficients.empty() &&
         params.size() == ColmapParameterCount(camera.model) && params[0] == params[1] &&
         params[2] == camera.width_px / 2.0 && params[3] == camera.height_px / 2.0 &&
         std::all_of(params.begin() + 4, params.end(), [](double value) { return value == 0.0; });
}

bool IsFoundByColmap(ColmapCameraModel model) {
  switch (model) {
    case ColmapCameraModel::kSimplePinhole:
    case ColmapCameraModel::kSimpleRadial:
    case ColmapCameraModel::kRadial:
    case ColmapCameraModel::kSimpleRadialFisheye:
    case ColmapCameraModel::kRadialFisheye:
      return true;
    default:
      return false;
  }
}

std::string ColmapModelName(ColmapCameraModel model) { return Row(model).name; }

std::size_t ColmapParameterCount(ColmapCameraModel model) { return Row(model).Parameters(); }

ColmapCameraModel ColmapModelFromName(const std::string& name) {
  for (const ModelRow& row : Rows()) {
    if (name == row.name) return row.colmap;
  }
  ThrowUnsupported(name);
}

ColmapCamera ToColmapCamera(const Camera& camera) {
  return Written(camera, Row(SmallestModel(camera)));
}

ColmapCamera ToColmapCamera(const Camera& camera, const ColmapCamera& before) {
  if (Holds(Row(before.model), camera)) return Written(camera, Row(before.model));
  const auto& rows = Rows();
  const auto row = std::find_if(rows.begin(), rows.end(), [&](const ModelRow& candidate) {
    return Holds(candidate, camera);
  });
  Check(row != rows.end(), "some model of COLMAP's has all parameters of a camera");
  return Written(camera, *row);
}

bool AreAsOne(const ColmapCamera& a, const ColmapCamera& b) {
  constexpr double kMostPx = 0.1;
  constexpr int kSteps = 8;
  if (a == b) return true;
  const Camera first = FromColmapCamera(a);
  const Camera second = FromColmapCamera(b);
  if (first.width_px != second.width_px || first.height_px != second.height_px) return false;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Eigen::Vector2d xy((first.width_px - 1.0) * i / kSteps,
                               (first.height_px - 1.0) * j / kSteps);
      const auto there = second.Project(first.Unproject(xy).homogeneous());
      if (!there || (*there - xy).norm() > kMostPx) return false;
    }
  }
  return true;
}

std::optional<double> FocalScaleOf(const ColmapCamera& camera, const ColmapCamera& reference) {
  if (camera == reference) return 1.0;
  if (camera.params.empty() || reference.params.empty()) return std::nullopt;
  const double scale = camera.params.front() / reference.params.front();
  ColmapCamera scaled = reference;
  scaled.params[0] = camera.params[0];
  if (Row(reference.model).two_focals) scaled.params.at(1) *= scale;
  // A scale that explains all of the difference is kept, however small.
  if (AreEqualButForRounding(camera, scaled)) return scale;
  if (AreAsOne(camera, reference)) return 1.0;
  return AreAsOne(camera, scaled) ? std::optional(scale) : std::nullopt;
}

Camera FromColmapCamera(const ColmapCamera& colmap) {
  const ModelRow& row = Row(colmap.model);
  const std::vector<double>& p = colmap.params;
  if (p.size() != row.Parameters()) {
    ThrowError(
        "COLMAP camera {} has {} parameters instead of {}", row.name, p.size(), row.Parameters());
  }
  Camera camera;
  camera.model = row.model;
  camera.width_px = colmap.width_px;
  camera.height_px = colmap.height_px;
  camera.known = colmap.prior_focal_length;
  std::size_t next = row.two_focals ? 2 : 1;
  camera.fx = p[0];
  camera.fy = p[next - 1];
  camera.cx = p[next++] - kColmapPixelShift;
  camera.cy = p[next++] - kColmapPixelShift;
  for (const auto coefficient : row.coefficients) camera.*coefficient = p[next++];
  if (const std::string fault = FaultOf(camera); !fault.empty()) {
    ThrowError("COLMAP camera {}: {}", row.name, fault);
  }
  return camera;
}

}  // namespace cohort
