#pragma once

#include <algorithm>
#include <cstddef>
#include <opencv2/core/mat.hpp>
#include <utility>
#include <vector>

namespace cohort {

// A texture with copies of half, a quarter ... of its size, for sampling without aliasing.
class MipMap {
 public:
  explicit MipMap(const cv::Mat& texture);

  float width() const { return levels_[0].width; }  // [texels]
  float height() const { return levels_[0].height; }

  // Value at (s, t), 0..1 across the texture (the centre of texel i is at (i + 0.5) / width),
  // linear between texels and between levels; lod 0 is the texture itself, 1 its half.
  float Sample(float s, float t, float lod) const {
    if (lod <= 0.0F) return levels_[0].Bilinear(s, t);
    const float clamped = std::min(lod, static_cast<float>(levels_.size()) - 1.001F);
    const int level = static_cast<int>(clamped);
    const float fine = levels_[static_cast<std::size_t>(level)].Bilinear(s, t);
    const float coarse = levels_[static_cast<std::size_t>(level) + 1].Bilinear(s, t);
    return fine + (clamped - static_cast<float>(level)) * (coarse - fine);
  }

 private:
  struct Level {
    cv::Mat texels;
    const float* data;
    int stride;
    float width, height, last_x, last_y;

    explicit Level(cv::Mat m)
        : texels(std::move(m)),
          data(texels.ptr<float>()),
          stride(static_cast<int>(texels.step1())),
          width(static_cast<float>(texels.cols)),
          height(static_cast<float>(texels.rows)),
          last_x(width - 1.001F),
          last_y(height - 1.001F) {}

    float Bilinear(float s, float t) const {
      const float x = std::clamp(s * width - 0.5F, 0.0F, last_x);
      const float y = std::clamp(t * height - 0.5F, 0.0F, last_y);
      const int ix = static_cast<int>(x);
      const int iy = static_cast<int>(y);
      const float a = x - static_cast<float>(ix);
      const float b = y - static_cast<float>(iy);
      const float* p = data + iy * stride + ix;
      const float* q = p + stride;
      const float top = p[0] + a * (p[1] - p[0]);
      const float bottom = q[0] + a * (q[1] - q[0]);
      return top + b * (bottom - top);
    }
  };
  std::vector<Level> levels_;
};

}  // namespace cohort
