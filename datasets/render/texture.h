#pragma once

#include <numbers>
#include <opencv2/core/mat.hpp>

#include "frontend/core/random_stream.h"

namespace cohort {

inline constexpr double kTurn = 2.0 * std::numbers::pi;  // [rad]

// The material of a surface. All are generated from random numbers with the statistics of
// photographs: a 1/f-like spectrum, edges and corners of all sizes, strong and weak parts. None
// uses a picture.
enum class Material {
  kPlaster,    // weak: slow shades, few stains and cracks
  kConcrete,   // pores, stains, formwork joints
  kBricks,     // 25 x 8 cm
  kPlanks,     // 14 cm wide, grain and knots
  kTiles,      // 30 cm, veined
  kCarpet,     // woven rows with a border
  kAsphalt,    // fine grit, cracks, patches
  kPoster,     // overlapping shapes and lines of letters
  kBooks,      // a row of spines
  kCardboard,  // tape, a label, dents
  kFabric,     // stripes and folds
  kFoliage,    // leaves over leaves
  kWindow,     // panes with reflections in a frame
  kDoor,       // panels and a handle
  kMetal,      // painted sheet with rust
  kSky         // clouds
};

struct TextureSpec {
  Material material = Material::kPlaster;
  double width_m = 1.0;
  double height_m = 1.0;
  double texels_per_m = 200.0;
  double brightness = 1.0;  // factor on the material's own reflectance
};

// Reflectance 0.015..0.9 in linear light, CV_32FC1; row 0 is the surface's upper edge.
cv::Mat MakeTexture(const TextureSpec& spec, RandomStream random);

}  // namespace cohort
