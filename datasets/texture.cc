#include "datasets/texture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr int kSide = 2048;  // a power of two; 2.5 mm a texel
constexpr double kTexelsPerMetre = kSide / kTextureMetres;

// Smooth noise that repeats after kSide: octaves from `coarsest` (a power of two) cells across,
// amplitudes falling by `gain` an octave (0.5 is 1/f). About -1..1.
cv::Mat FractalNoise(RandomStream random, int coarsest, double gain, int stretch_x = 1) {
  cv::Mat sum = cv::Mat::zeros(kSide, kSide, CV_32FC1);
  double amplitude = 1.0;
  double total = 0.0;
  for (int cells = coarsest; cells <= kSide / 4; cells *= 2) {
    const int cells_x = std::max(1, cells / stretch_x);
    cv::Mat lattice(cells, cells_x, CV_32FC1);
    for (int y = 0; y < cells; ++y) {
      for (int x = 0; x < cells_x; ++x) {
        lattice.at<float>(y, x) = static_cast<float>(random.Uniform(-1.0, 1.0));
      }
    }
    // Two more cells on each side, wrapped round, so that the enlarged picture repeats without a
    // seam.
    cv::Mat padded;
    cv::copyMakeBorder(lattice, padded, 2, 2, 2, 2, cv::BORDER_WRAP);
    const int step_x = kSide / cells_x;
    const int step_y = kSide / cells;
    cv::Mat enlarged;
    cv::resize(padded,
               enlarged,
               cv::Size(padded.cols * step_x, padded.rows * step_y),
               0,
               0,
               cv::INTER_CUBIC);
    const cv::Mat octave = enlarged(cv::Rect(2 * step_x, 2 * step_y, kSide, kSide));
    sum += amplitude * octave;
    total += amplitude * amplitude;
    amplitude *= gain;
  }
  return sum / std::sqrt(total);
}

// Draws wrapped round the edges, so that the texture repeats without a seam.
template <typename Draw>
void Wrapped(const cv::Rect& box, const Draw& draw) {
  for (const int dx : {-kSide, 0, kSide}) {
    for (const int dy : {-kSide, 0, kSide}) {
      const cv::Rect moved = box + cv::Point(dx, dy);
      if ((moved & cv::Rect(0, 0, kSide, kSide)).area() > 0) draw(moved);
    }
  }
}

int Texels(double metres) { return static_cast<int>(std::lround(metres * kTexelsPerMetre)); }

// Rows of blocks with joints between them, each with a shade of its own.
void Blocks(cv::Mat& image,
            RandomStream& random,
            double width_m,
            double height_m,
            double joint_m,
            double spread,
            bool staggered) {
  const int rows = std::max(1, static_cast<int>(std::lround(kTextureMetres / height_m)));
  const int columns = std::max(1, static_cast<int>(std::lround(kTextureMetres / width_m)));
  const int joint = std::max(1, Texels(joint_m));
  for (int r = 0; r < rows; ++r) {
    const int shift = staggered ? static_cast<int>(random.Below(kSide)) : 0;
    const int top = r * kSide / rows;
    const int bottom = (r + 1) * kSide / rows;
    for (int c = 0; c < columns; ++c) {
      const int left = shift + c * kSide / columns;
      const int right = shift + (c + 1) * kSide / columns;
      const double shade = spread * random.Uniform(-1.0, 1.0);
      Wrapped(
          cv::Rect(left, top, right - left - joint, bottom - top - joint),
          [&](const cv::Rect& box) { image(box & cv::Rect(0, 0, kSide, kSide)) += shade + 0.18; });
    }
  }
}

void Posters(cv::Mat& image, RandomStream& random, int count, double largest_m) {
  for (int i = 0; i < count; ++i) {
    const int width = Texels(random.Uniform(0.05, largest_m));
    const int height = Texels(random.Uniform(0.05, largest_m));
    const cv::Rect box(static_cast<int>(random.Below(kSide)),
                       static_cast<int>(random.Below(kSide)),
                       width,
                       height);
    const float value = static_cast<float>(random.Uniform(0.05, 0.95));
    const std::uint64_t shape = random.Below(4);
    const double angle = random.Uniform(0.0, 180.0);
    Wrapped(box, [&](const cv::Rect& b) {
      const cv::Point centre(b.x + b.width / 2, b.y + b.height / 2);
      if (shape == 0) {
        cv::rectangle(image, b, cv::Scalar(value), cv::FILLED);
      } else if (shape == 1) {
        cv::ellipse(image,
                    centre,
                    cv::Size(b.width / 2, b.height / 2),
                    angle,
                    0,
                    360,
                    cv::Scalar(value),
                    cv::FILLED,
                    cv::LINE_8);
      } else if (shape == 2) {
        const cv::Point corners[3] = {
            {b.x, b.y + b.height}, {b.x + b.width, b.y + b.height / 2}, {b.x + b.width / 3, b.y}};
        cv::fillConvexPoly(image, corners, 3, cv::Scalar(value));
      } else {
        cv::line(image,
                 {b.x, b.y},
                 {b.x + b.width, b.y + b.height},
                 cv::Scalar(value),
                 std::max(2, b.width / 12));
      }
    });
  }
}

cv::Mat Draw(TextureKind kind, std::uint64_t seed) {
  RandomStream random(seed, "texture/layout");
  const RandomStream noise(seed, "texture/noise");
  const cv::Mat rough = FractalNoise(noise.Fork(0), 8, 0.62);
  cv::Mat image(kSide, kSide, CV_32FC1);
  switch (kind) {
    case TextureKind::kConcrete:
      image = 0.5 + 0.2 * rough;
      Posters(image, random, 25, 0.15);
      image += 0.05 * FractalNoise(noise.Fork(1), 64, 0.8);
      break;
    case TextureKind::kBricks:
      image = 0.35 + 0.1 * rough;
      Blocks(image, random, 0.26, 0.085, 0.012, 0.12, true);
      image += 0.06 * FractalNoise(noise.Fork(1), 128, 0.8);
      break;
    case TextureKind::kPlanks:
      image = 0.3 + 0.05 * rough + 0.12 * FractalNoise(noise.Fork(1), 64, 0.7, 16);
      Blocks(image, random, 1.7, 0.14, 0.006, 0.14, true);
      break;
    case TextureKind::kTiles:
      image = 0.4 + 0.06 * rough;
      Blocks(image, random, 0.34, 0.34, 0.012, 0.1, false);
      image += 0.05 * FractalNoise(noise.Fork(1), 32, 0.75);
      break;
    case TextureKind::kPosters:
      image = 0.55 + 0.08 * rough;
      Posters(image, random, 60, 0.9);
      Posters(image, random, 260, 0.25);
      image += 0.04 * FractalNoise(noise.Fork(1), 32, 0.7);
      break;
    case TextureKind::kPlaster:  // weak: little but slow shades and a few stains
      image = 0.62 + 0.06 * rough;
      Posters(image, random, 6, 0.12);
      break;
    case TextureKind::kGravel:
      image = 0.45 + 0.12 * rough + 0.16 * FractalNoise(noise.Fork(1), 128, 0.9);
      break;
    case TextureKind::kFabric:
      image = 0.5 + 0.14 * rough;
      Blocks(image, random, 0.2, 0.2, 0.07, 0.15, false);
      image += 0.07 * FractalNoise(noise.Fork(1), 64, 0.85);
      break;
  }
  return cv::min(cv::max(image, 0.02), 0.98);
}

// Bilinear, wrapping round; x, y in texels of the level, texel i's centre at i + 0.5.
float Bilinear(const cv::Mat& level, double x, double y) {
  const int mask = level.cols - 1;
  const double u = x - 0.5;
  const double v = y - 0.5;
  const double fu = std::floor(u);
  const double fv = std::floor(v);
  const auto a = static_cast<float>(u - fu);
  const auto b = static_cast<float>(v - fv);
  const auto iu = static_cast<std::int64_t>(fu);
  const auto iv = static_cast<std::int64_t>(fv);
  const int x0 = static_cast<int>(iu & mask);
  const int x1 = static_cast<int>((iu + 1) & mask);
  const float* p = level.ptr<float>(static_cast<int>(iv & mask));
  const float* q = level.ptr<float>(static_cast<int>((iv + 1) & mask));
  const float top = p[x0] + a * (p[x1] - p[x0]);
  return top + b * (q[x0] + a * (q[x1] - q[x0]) - top);
}

}  // namespace

Texture::Texture(TextureKind kind, std::uint64_t seed) {
  levels_.push_back(Draw(kind, seed));
  while (levels_.back().cols > 4) {
    cv::Mat half;
    cv::resize(levels_.back(), half, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
    levels_.push_back(half);
  }
}

float Texture::At(double x, double y, double footprint_m) const {
  const double wanted = std::log2(std::max(footprint_m * kTexelsPerMetre, 1.0));
  const double clamped = std::min(wanted, static_cast<double>(levels_.size() - 2));
  const auto fine = static_cast<std::size_t>(clamped);
  const auto t = static_cast<float>(clamped - static_cast<double>(fine));
  const double u = x * kTexelsPerMetre;
  const double v = y * kTexelsPerMetre;
  const double scale = std::ldexp(1.0, -static_cast<int>(fine));
  const float near = Bilinear(levels_[fine], u * scale, v * scale);
  if (t == 0.0F) return near;
  const float far = Bilinear(levels_[fine + 1], u * scale * 0.5, v * scale * 0.5);
  return near + t * (far - near);
}

}  // namespace cohort
