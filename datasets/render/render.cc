#include "datasets/render/render.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "datasets/render/lighting.h"
#include "frontend/core/parallel.h"
#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr double kPictureGamma = 2.2;
constexpr double kMeanLight = 0.2;  // of the first frame
constexpr int kSamples = 9;

// Sample k of a pixel, from its centre [px]: a point-symmetric pattern with no two samples in one
// row or column, so that vertical and horizontal edges get nine shades too. It is dense in the
// middle and sparse towards the neighbours' centres (a tent, two pixels wide), like the response of
// a lens and a pixel's area, which leaves little above the Nyquist frequency.
Eigen::Vector2d SampleOffset(int k) {
  const auto tent = [](int place) {  // 0 .. 8, quantiles of the tent
    const double u = (place + 0.5) / kSamples;
    return u < 0.5 ? std::sqrt(2.0 * u) - 1.0 : 1.0 - std::sqrt(2.0 - 2.0 * u);
  };
  return {tent(k), tent((4 + 2 * (k - 4) + 9) % 9)};
}

struct FrameTriangle {
  ProjectedTriangle projected;
  std::size_t patch;
  Eigen::Vector3d s;  // with the homogeneous pixel: s / depth
  Eigen::Vector3d t;
};

// The triangles that the rows may show, at their positions at one time.
std::vector<FrameTriangle> ProjectScene(const SyntheticScene& scene,
                                        double frame,
                                        const cv::Range& rows) {
  const Rigid3 cam_from_world = scene.CamFromWorld(frame);
  std::vector<Eigen::Vector3d> x_in_cam = scene.VerticesInWorld(frame);
  for (Eigen::Vector3d& x : x_in_cam) x = cam_from_world * x;
  std::vector<FrameTriangle> result;
  for (const SyntheticScene::Triangle& triangle : scene.triangles()) {
    std::array<Eigen::Vector3d, 3> corners;
    Eigen::Matrix<double, 2, 3> st;
    for (std::size_t k = 0; k < 3; ++k) {
      corners[k] = x_in_cam[triangle.vertices[k]];
      st.col(static_cast<Eigen::Index>(k)) = scene.vertices()[triangle.vertices[k]];
    }
    const auto projected = ProjectTriangle(scene.camera(), corners);
    if (!projected || projected->right < -1.0 || projected->bottom < rows.start - 1.0 ||
        projected->left > scene.camera().width_px || projected->top > rows.end) {
      continue;
    }
    const Eigen::Matrix<double, 2, 3> st_by_depth = st * projected->weights_by_depth;
    result.push_back({*projected,
                      triangle.patch,
                      st_by_depth.row(0).transpose(),
                      st_by_depth.row(1).transpose()});
  }
  return result;
}

// The rows that are exposed at the same time: all, or each separately.
std::vector<cv::Range> RowsAtOnce(int height, bool rolling) {
  if (!rolling) return {cv::Range(0, height)};
  std::vector<cv::Range> rows;
  for (int y = 0; y < height; ++y) rows.emplace_back(y, y + 1);
  return rows;
}

// What one sample of every pixel sees.
struct Visibility {
  cv::Mat inverse_depth;  // CV_32FC1, 0: nothing
  cv::Mat triangle;       // CV_32SC1
};

void Rasterize(const std::vector<FrameTriangle>& triangles,
               const Eigen::Vector2d& offset,
               const cv::Range& rows,
               Visibility& seen) {
  seen.inverse_depth.rowRange(rows).setTo(0.0F);
  const int width = seen.inverse_depth.cols;
  const double first_row = rows.start;
  const double last_row = rows.end - 1.0;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const ProjectedTriangle& p = triangles[i].projected;
    const Eigen::Matrix3d& w = p.weights_by_depth;
    const int top = static_cast<int>(std::clamp(std::floor(p.top - 1.0), first_row, last_row));
    const int bottom = static_cast<int>(std::clamp(std::ceil(p.bottom + 1.0), first_row, last_row));
    for (int y = top; y <= bottom; ++y) {
      // The span of x in which all three weights are >= 0; each is linear in x.
      double first = 0.0;
      double last = width - 1.0;
      for (int k = 0; k < 3; ++k) {
        const double slope = w(k, 0);
        const double start =
            slope * offset.x() + w(k, 1) * (y + offset.y()) + w(k, 2) + p.tolerance;
        if (slope > 0.0) {
          first = std::max(first, -start / slope);
        } else if (slope < 0.0) {
          last = std::min(last, start / -slope);
        } else if (start < 0.0) {
          last = -1.0;
        }
      }
      if (first > last) continue;
      const double slope = p.inverse_depth.x();
      const double start =
          slope * offset.x() + p.inverse_depth.y() * (y + offset.y()) + p.inverse_depth.z();
      float* nearest = seen.inverse_depth.ptr<float>(y);
      std::int32_t* triangle = seen.triangle.ptr<std::int32_t>(y);
      const int end = static_cast<int>(std::floor(last));
      for (int x = static_cast<int>(std::ceil(first)); x <= end; ++x) {
        const auto inverse_depth = static_cast<float>(slope * x + start);
        if (inverse_depth > nearest[x]) {
          nearest[x] = inverse_depth;
          triangle[x] = static_cast<std::int32_t>(i);
        }
      }
    }
  }
}

// Adds the textures' values at the visible surfaces.
void Shade(const std::vector<FrameTriangle>& triangles,
           const std::vector<MipMap>& textures,
           const Eigen::Vector2d& offset,
           const cv::Range& rows,
           const Visibility& seen,
           cv::Mat& light) {
  for (int y = rows.start; y < rows.end; ++y) {
    const float* inverse_depth = seen.inverse_depth.ptr<float>(y);
    const std::int32_t* index = seen.triangle.ptr<std::int32_t>(y);
    float* out = light.ptr<float>(y);
    const double py = y + offset.y();
    for (int x = 0; x < light.cols; ++x) {
      if (inverse_depth[x] == 0.0F) continue;
      const FrameTriangle& triangle = triangles[static_cast<std::size_t>(index[x])];
      const MipMap& texture = textures[triangle.patch];
      const double px = x + offset.x();
      const Eigen::Vector3d& q = triangle.projected.inverse_depth;
      const double depth = 1.0 / (q.x() * px + q.y() * py + q.z());
      const double s = depth * (triangle.s.x() * px + triangle.s.y() * py + triangle.s.z());
      const double t = depth * (triangle.t.x() * px + triangle.t.y() * py + triangle.t.z());
      // Texels per pixel, along both axes of the picture.
      const float w = texture.width() * static_cast<float>(depth);
      const float h = texture.height() * static_cast<float>(depth);
      const float sx = w * static_cast<float>(triangle.s.x() - s * q.x());
      const float sy = w * static_cast<float>(triangle.s.y() - s * q.y());
      const float tx = h * static_cast<float>(triangle.t.x() - t * q.x());
      const float ty = h * static_cast<float>(triangle.t.y() - t * q.y());
      const float longest2 = std::max(sx * sx + tx * tx, sy * sy + ty * ty);
      const float area = std::abs(sx * ty - sy * tx);
      // Each of the nine samples covers half the pixel's width; if the footprint is long and
      // narrow, they share its length.
      const float footprint2 = std::max(area * area / (longest2 + 1e-12F), longest2 / 16.0F);
      const float lod = 0.5F * std::log2(1.3F * footprint2 + 1e-12F);
      out[x] += texture.Sample(static_cast<float>(s), static_cast<float>(t), lod);
    }
  }
}

}  // namespace

Renderer::Renderer(const SyntheticScene& scene, unsigned threads) : scene_(scene) {
  const Lighting lighting(scene);
  const RandomStream texture_random(scene.options().seed, "scene/texture");
  const RandomStream light_random(scene.options().seed, "scene/light");
  std::vector<cv::Mat> drawn(scene.patches().size());
  ParallelFor(drawn.size(), threads, [&](std::size_t i) {
    const Patch& patch = scene.patches()[i];
    drawn[i] = MakeTexture(patch.texture, texture_random.Fork(i));
    cv::Mat light = lighting.LightMap(patch, light_random.Fork(i));
    cv::GaussianBlur(light, light, cv::Size(3, 3), 0.8, 0.8, cv::BORDER_REPLICATE);
    cv::resize(light, light, drawn[i].size(), 0, 0, cv::INTER_CUBIC);
    cv::multiply(drawn[i], cv::max(light, 0.03), drawn[i]);
  });
  for (cv::Mat& texture : drawn) textures_.emplace_back(std::move(texture));
  // Without the rolling shutter, so that the exposure does not depend on the readout.
  const double mean = cv::mean(LightOf(0.0, false))[0];
  if (mean > 0.0) exposure_ = kMeanLight / mean;
}

cv::Mat Renderer::RenderLight(double frame) const {
  return LightOf(frame, scene_.HasRollingShutter());
}

cv::Mat Renderer::LightOf(double frame, bool rolling) const {
  const cv::Size size(scene_.camera().width_px, scene_.camera().height_px);
  Visibility seen{cv::Mat(size, CV_32FC1), cv::Mat(size, CV_32SC1)};
  cv::Mat light = cv::Mat::zeros(size, CV_32FC1);
  for (const cv::Range& rows : RowsAtOnce(size.height, rolling)) {
    const double time = rolling ? scene_.TimeOfRow(frame, rows.start) : frame;
    const std::vector<FrameTriangle> triangles = ProjectScene(scene_, time, rows);
    for (int k = 0; k < kSamples; ++k) {
      Rasterize(triangles, SampleOffset(k), rows, seen);
      Shade(triangles, textures_, SampleOffset(k), rows, seen, light);
    }
  }
  light *= exposure_ / kSamples;
  return light;
}

cv::Mat Renderer::RenderGray(double frame) const {
  cv::Mat value;
  cv::pow(cv::min(RenderLight(frame), 1.0), 1.0 / kPictureGamma, value);
  cv::Mat gray;
  value.convertTo(gray, CV_8U, 255.0);
  return gray;
}

cv::Mat RenderDepth(const SyntheticScene& scene, double frame) {
  const cv::Size size(scene.camera().width_px, scene.camera().height_px);
  Visibility seen{cv::Mat(size, CV_32FC1), cv::Mat(size, CV_32SC1)};
  for (const cv::Range& rows : RowsAtOnce(size.height, scene.HasRollingShutter())) {
    const double time = scene.HasRollingShutter() ? scene.TimeOfRow(frame, rows.start) : frame;
    Rasterize(ProjectScene(scene, time, rows), Eigen::Vector2d::Zero(), rows, seen);
  }
  cv::Mat depth;
  cv::divide(1.0, seen.inverse_depth, depth);
  depth.setTo(0.0F, seen.inverse_depth == 0.0F);
  return depth;
}

}  // namespace cohort
