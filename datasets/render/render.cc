#include "datasets/render/render.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "frontend/core/parallel.h"
#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr double kGamma = 2.2;
constexpr double kMeanLight = 0.2;  // of the first frame
constexpr int kSamples = 9;

// Sample k of a pixel, from its centre [px]: nine rooks, point-symmetric, no two in one row or
// column, so that upright and level edges get nine shades too; dense in the middle and thin towards
// the neighbours' centres (a tent, two pixels wide), as a lens and a pixel's area see. That leaves
// little above the Nyquist frequency.
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

std::vector<FrameTriangle> ProjectScene(const SyntheticScene& scene, double frame) {
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
    if (!projected || projected->right < -1.0 || projected->bottom < -1.0 ||
        projected->left > scene.camera().width_px || projected->top > scene.camera().height_px) {
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

// What is seen at every pixel's sample.
struct Visibility {
  cv::Mat inverse_depth;  // CV_32FC1, 0: nothing
  cv::Mat triangle;       // CV_32SC1
};

void Rasterize(const std::vector<FrameTriangle>& triangles,
               const Eigen::Vector2d& offset,
               Visibility& seen) {
  seen.inverse_depth.setTo(0.0F);
  const int width = seen.inverse_depth.cols;
  const int height = seen.inverse_depth.rows;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const ProjectedTriangle& p = triangles[i].projected;
    const Eigen::Matrix3d& w = p.weights_by_depth;
    const int top = static_cast<int>(std::clamp(std::floor(p.top - 1.0), 0.0, height - 1.0));
    const int bottom = static_cast<int>(std::clamp(std::ceil(p.bottom + 1.0), 0.0, height - 1.0));
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

// Adds the textures' values where they are seen.
void Shade(const std::vector<FrameTriangle>& triangles,
           const std::vector<MipMap>& textures,
           const Eigen::Vector2d& offset,
           const Visibility& seen,
           cv::Mat& light) {
  for (int y = 0; y < light.rows; ++y) {
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
      // Texels a pixel, along both axes of the picture.
      const float w = texture.width() * static_cast<float>(depth);
      const float h = texture.height() * static_cast<float>(depth);
      const float sx = w * static_cast<float>(triangle.s.x() - s * q.x());
      const float sy = w * static_cast<float>(triangle.s.y() - s * q.y());
      const float tx = h * static_cast<float>(triangle.t.x() - t * q.x());
      const float ty = h * static_cast<float>(triangle.t.y() - t * q.y());
      const float longest2 = std::max(sx * sx + tx * tx, sy * sy + ty * ty);
      const float area = std::abs(sx * ty - sy * tx);
      // Nine samples look at half the pixel's width each; where the footprint is long and narrow
      // they share its length.
      const float footprint2 = std::max(area * area / (longest2 + 1e-12F), longest2 / 16.0F);
      const float lod = 0.5F * std::log2(1.3F * footprint2 + 1e-12F);
      out[x] += texture.Sample(static_cast<float>(s), static_cast<float>(t), lod);
    }
  }
}

// Light that falls on a scene's surfaces: a soft lamp with shadows, and light from all sides where
// nothing near stands in its way.
class Lighting {
 public:
  explicit Lighting(const SyntheticScene& scene)
      : design_(scene.design()), vertices_(scene.VerticesInWorld(0.0)) {
    for (const SyntheticScene::Triangle& triangle : scene.triangles()) {
      if (design_.patches[triangle.patch].moves) continue;
      const Eigen::Vector3d& a = vertices_[triangle.vertices[0]];
      blockers_.push_back(
          {a, vertices_[triangle.vertices[1]] - a, vertices_[triangle.vertices[2]] - a});
    }
  }

  // CV_32FC1, one value every decimetre or so of a patch.
  cv::Mat LightMap(const Patch& patch, RandomStream random) const {
    const auto cells = [](double length_m) {
      return std::clamp(static_cast<int>(std::lround(length_m / 0.1)), 3, 60);
    };
    Eigen::AlignedBox3d box;
    for (int i = 0; i < 64; ++i) box.extend(patch.x_in_world((i % 8) / 7.0, (i / 8) / 7.0, 0.0));
    const std::vector<Blocker> near = BlockersIn(box, kReach);
    const std::vector<Blocker> before_lamp =
        BlockersIn(Eigen::AlignedBox3d(box).extend(design_.lamp), LampSize());
    cv::Mat map(cells(patch.texture.height_m), cells(patch.texture.width_m), CV_32FC1);
    for (int y = 0; y < map.rows; ++y) {
      for (int x = 0; x < map.cols; ++x) {
        const double s = (x + 0.5) / map.cols;
        const double t = (y + 0.5) / map.rows;
        map.at<float>(y, x) = static_cast<float>(LightAt(patch, s, t, near, before_lamp, random));
      }
    }
    return map;
  }

 private:
  static constexpr double kReach = 0.7;  // [m]
  struct Blocker {
    Eigen::Vector3d corner, u, v;
  };

  double LampSize() const { return 0.06 * (design_.lamp - design_.viewpoint.target).norm(); }

  std::vector<Blocker> BlockersIn(const Eigen::AlignedBox3d& box, double margin) const {
    std::vector<Blocker> result;
    for (const Blocker& b : blockers_) {
      const Eigen::AlignedBox3d reach =
          Eigen::AlignedBox3d(b.corner).extend(b.corner + b.u).extend(b.corner + b.v);
      if (box.squaredExteriorDistance(reach) <= margin * margin) result.push_back(b);
    }
    return result;
  }

  double LightAt(const Patch& patch,
                 double s,
                 double t,
                 const std::vector<Blocker>& near,
                 const std::vector<Blocker>& before_lamp,
                 RandomStream& random) const {
    const double step = 1e-3;
    const Eigen::Vector3d x = patch.x_in_world(s, t, 0.0);
    const Eigen::Vector3d along_s = patch.x_in_world(s + step, t, 0.0) - x;
    const Eigen::Vector3d along_t = patch.x_in_world(s, t + step, 0.0) - x;
    Eigen::Vector3d normal = along_t.cross(along_s).normalized();
    // The side that is looked at.
    if (normal.dot(design_.viewpoint.centre - x) < 0.0) normal = -normal;
    const Eigen::Vector3d origin = x + 0.01 * normal;

    constexpr int kLampRays = 6;
    constexpr int kSkyRays = 10;
    const double scale2 = (design_.lamp - design_.viewpoint.target).squaredNorm() + 4.0;
    double direct = 0.0;
    for (int i = 0; i < kLampRays; ++i) {
      const Eigen::Vector3d jitter(
          random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
      const Eigen::Vector3d to_lamp = design_.lamp + LampSize() * jitter - origin;
      const double cosine = normal.dot(to_lamp.normalized());
      if (cosine <= 0.0 || IsBlocked(before_lamp, origin, to_lamp)) continue;
      direct += cosine / (0.5 + to_lamp.squaredNorm() / scale2);
    }
    double open = 0.0;
    for (int i = 0; i < kSkyRays; ++i) {
      Eigen::Vector3d direction(random.Gaussian(), random.Gaussian(), random.Gaussian());
      direction = (direction.normalized() + 1.01 * normal).normalized();  // cosine-weighted
      open += IsBlocked(near, origin, kReach * direction) ? 0.35 : 1.0;
    }
    return design_.ambient * open / kSkyRays + 1.2 * (1.0 - design_.ambient) * direct / kLampRays;
  }

  static bool IsBlocked(const std::vector<Blocker>& blockers,
                        const Eigen::Vector3d& origin,
                        const Eigen::Vector3d& way) {
    for (const Blocker& b : blockers) {
      const Eigen::Vector3d p = way.cross(b.v);
      const double det = b.u.dot(p);
      if (std::abs(det) < 1e-12) continue;
      const Eigen::Vector3d from = origin - b.corner;
      const double alpha = from.dot(p) / det;
      if (alpha < 0.0 || alpha > 1.0) continue;
      const Eigen::Vector3d q = from.cross(b.u);
      const double beta = way.dot(q) / det;
      if (beta < 0.0 || alpha + beta > 1.0) continue;
      const double at = b.v.dot(q) / det;
      if (at > 0.0 && at < 1.0) return true;
    }
    return false;
  }

  const SceneDesign& design_;
  std::vector<Eigen::Vector3d> vertices_;
  std::vector<Blocker> blockers_;
};

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
  const double mean = cv::mean(RenderLight(0.0))[0];
  if (mean > 0.0) exposure_ = kMeanLight / mean;
}

cv::Mat Renderer::RenderLight(double frame) const {
  const std::vector<FrameTriangle> triangles = ProjectScene(scene_, frame);
  const cv::Size size(scene_.camera().width_px, scene_.camera().height_px);
  Visibility seen{cv::Mat(size, CV_32FC1), cv::Mat(size, CV_32SC1)};
  cv::Mat light = cv::Mat::zeros(size, CV_32FC1);
  for (int k = 0; k < kSamples; ++k) {
    Rasterize(triangles, SampleOffset(k), seen);
    Shade(triangles, textures_, SampleOffset(k), seen, light);
  }
  light *= exposure_ / kSamples;
  return light;
}

cv::Mat Renderer::RenderGray(double frame) const {
  cv::Mat value;
  cv::pow(cv::min(RenderLight(frame), 1.0), 1.0 / kGamma, value);
  cv::Mat gray;
  value.convertTo(gray, CV_8U, 255.0);
  return gray;
}

cv::Mat RenderDepth(const SyntheticScene& scene, double frame) {
  const cv::Size size(scene.camera().width_px, scene.camera().height_px);
  Visibility seen{cv::Mat(size, CV_32FC1), cv::Mat(size, CV_32SC1)};
  Rasterize(ProjectScene(scene, frame), Eigen::Vector2d::Zero(), seen);
  cv::Mat depth;
  cv::divide(1.0, seen.inverse_depth, depth);
  depth.setTo(0.0F, seen.inverse_depth == 0.0F);
  return depth;
}

}  // namespace cohort
