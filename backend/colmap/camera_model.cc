#include "backend/colmap/camera_model.h"

#include <array>

#include "frontend/core/error.h"

namespace cohort {
namespace {

struct ModelRow {
  ColmapCameraModel model;
  const char* name;
  std::size_t parameters;
};
constexpr std::array<ModelRow, 5> kModels{{
    {ColmapCameraModel::kSimplePinhole, "SIMPLE_PINHOLE", 3},
    {ColmapCameraModel::kPinhole, "PINHOLE", 4},
    {ColmapCameraModel::kSimpleRadial, "SIMPLE_RADIAL", 4},
    {ColmapCameraModel::kRadial, "RADIAL", 5},
    {ColmapCameraModel::kOpencv, "OPENCV", 8},
}};

const ModelRow& Row(ColmapCameraModel model) {
  for (const ModelRow& row : kModels) {
    if (row.model == model) return row;
  }
  ThrowError(
      "COLMAP camera model {} is not supported: use one of SIMPLE_PINHOLE, PINHOLE, "
      "SIMPLE_RADIAL, RADIAL, OPENCV",
      static_cast<int>(model));
}

}  // namespace

std::string ColmapModelName(ColmapCameraModel model) { return Row(model).name; }

std::size_t ColmapParameterCount(ColmapCameraModel model) { return Row(model).parameters; }

ColmapCameraModel ColmapModelFromName(const std::string& name) {
  for (const ModelRow& row : kModels) {
    if (name == row.name) return row.model;
  }
  ThrowError(
      "COLMAP camera model {} is not supported: use one of SIMPLE_PINHOLE, PINHOLE, "
      "SIMPLE_RADIAL, RADIAL, OPENCV",
      name);
}

ColmapCamera ToColmapCamera(const Camera& camera) {
  ColmapCamera result;
  result.width_px = camera.width_px;
  result.height_px = camera.height_px;
  result.prior_focal_length = camera.known;
  const double cx = camera.cx + kColmapPixelShift;
  const double cy = camera.cy + kColmapPixelShift;
  if (!camera.known) {
    result.model = ColmapCameraModel::kSimpleRadial;
    result.params = {0.5 * (camera.fx + camera.fy), cx, cy, camera.k1};
  } else if (camera.HasDistortion()) {
    result.model = ColmapCameraModel::kOpencv;
    result.params = {camera.fx, camera.fy, cx, cy, camera.k1, camera.k2, camera.p1, camera.p2};
  } else {
    result.model = ColmapCameraModel::kPinhole;
    result.params = {camera.fx, camera.fy, cx, cy};
  }
  return result;
}

Camera FromColmapCamera(const ColmapCamera& colmap) {
  const ModelRow& row = Row(colmap.model);
  const std::vector<double>& p = colmap.params;
  if (p.size() != row.parameters) {
    ThrowError(
        "COLMAP camera {} has {} parameters instead of {}", row.name, p.size(), row.parameters);
  }
  Camera camera;
  camera.width_px = colmap.width_px;
  camera.height_px = colmap.height_px;
  camera.known = colmap.prior_focal_length;
  const bool two_focals =
      colmap.model == ColmapCameraModel::kPinhole || colmap.model == ColmapCameraModel::kOpencv;
  const std::size_t next = two_focals ? 2 : 1;
  camera.fx = p[0];
  camera.fy = two_focals ? p[1] : p[0];
  camera.cx = p[next] - kColmapPixelShift;
  camera.cy = p[next + 1] - kColmapPixelShift;
  double* const distortion[] = {&camera.k1, &camera.k2, &camera.p1, &camera.p2};
  for (std::size_t i = next + 2; i < p.size(); ++i) *distortion[i - next - 2] = p[i];
  return camera;
}

}  // namespace cohort
