#include "frontend/energy/patch_energy.h"

#include <algorithm>
#include <cmath>

#include "frontend/core/error.h"
#include "frontend/image/sampling.h"

namespace cohort {

double PatchEnergy(const cv::Mat& picture,
                   const Eigen::Vector2d& x,
                   std::span<const float> patch,
                   int n) {
  const int area = n * n;
  Check(static_cast<int>(patch.size()) == area && area <= kMaxPatchArea, "patch is n x n");
  float values[kMaxPatchArea];
  SamplePatch(picture, x.x(), x.y(), n, values);
  float sum = 0.0F;
  for (int i = 0; i < area; ++i) sum += std::abs(values[i] - patch[i]);
  return static_cast<double>(sum) / area;
}

PatchGradient PatchEnergyGradient(const cv::Mat& picture,
                                  const Eigen::Vector2d& x,
                                  std::span<const float> patch,
                                  int n) {
  const int area = n * n;
  Check(static_cast<int>(patch.size()) == area && area <= kMaxPatchArea, "patch is n x n");
  float values[kMaxPatchArea];
  float dx[kMaxPatchArea];
  float dy[kMaxPatchArea];
  SamplePatchWithGradient(picture, x.x(), x.y(), n, values, dx, dy);
  float sum = 0.0F;
  float gx = 0.0F;
  float gy = 0.0F;
  for (int i = 0; i < area; ++i) {
    const float r = values[i] - patch[i];
    const float sign = static_cast<float>((r > 0.0F) - (r < 0.0F));
    sum += std::abs(r);
    gx += sign * dx[i];
    gy += sign * dy[i];
  }
  return {static_cast<double>(sum) / area, Eigen::Vector2d(gx, gy) / area};
}

PatchQuadratic PatchEnergyQuadratic(const cv::Mat& picture,
                                    const Eigen::Vector2d& x,
                                    std::span<const float> patch,
                                    int n,
                                    double floor) {
  const int area = n * n;
  Check(static_cast<int>(patch.size()) == area && area <= kMaxPatchArea, "patch is n x n");
  float values[kMaxPatchArea];
  float dx[kMaxPatchArea];
  float dy[kMaxPatchArea];
  SamplePatchWithGradient(picture, x.x(), x.y(), n, values, dx, dy);
  const auto least = static_cast<float>(floor);
  float sum = 0.0F;
  float gx = 0.0F;
  float gy = 0.0F;
  float hxx = 0.0F;
  float hxy = 0.0F;
  float hyy = 0.0F;
  for (int i = 0; i < area; ++i) {
    const float r = values[i] - patch[i];
    const float w = 1.0F / std::max(std::abs(r), least);
    sum += std::abs(r);
    gx += w * r * dx[i];
    gy += w * r * dy[i];
    hxx += w * dx[i] * dx[i];
    hxy += w * dx[i] * dy[i];
    hyy += w * dy[i] * dy[i];
  }
  PatchQuadratic q;
  q.energy = static_cast<double>(sum) / area;
  q.gradient = Eigen::Vector2d(gx, gy) / area;
  q.hessian << hxx, hxy, hxy, hyy;
  q.hessian /= area;
  return q;
}

}  // namespace cohort
