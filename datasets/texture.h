#pragma once

#include <cstdint>
#include <opencv2/core/mat.hpp>
#include <string_view>
#include <vector>

namespace cohort {

// Procedural textures with the statistics of photographs: a 1/f spectrum, edges, flat parts. All
// are drawn from the seed; none is anybody's picture.
enum class TextureKind {
  kConcrete,
  kBricks,
  kPlanks,
  kTiles,
  kPosters,
  kPlaster,
  kGravel,
  kFabric
};

// A square of kTextureMetres, repeated endlessly, as CV_32FC1 in 0..1 with its mip levels.
class Texture {
 public:
  Texture(TextureKind kind, std::uint64_t seed);

  // Value at (x, y) [m], averaged over a footprint of `footprint_m` (trilinear).
  float At(double x, double y, double footprint_m) const;

 private:
  std::vector<cv::Mat> levels_;
};

inline constexpr double kTextureMetres = 5.12;

}  // namespace cohort
