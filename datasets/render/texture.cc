#include "datasets/render/texture.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>

#include "datasets/render/canvas.h"
#include "frontend/core/error.h"

namespace cohort {
namespace {

void Plaster(Canvas& c) {
  c.Fill(0.55);
  c.Add(c.Noise(1.5, 0.85, 0.02), 0.09);
  c.Stains(0.8, 0.15, -0.15);
  for (int i = 0; i < c.Count(0.25); ++i) c.Crack(c.Uniform(0.2, 1.0), 0.002, 0.2, 0.6);
  for (int i = 0; i < c.Count(1.0); ++i) {  // nail holes and scratches
    const cv::Point2d p = c.Anywhere();
    const double r = c.Texels(c.Uniform(0.003, 0.012));
    const double tone = c.Uniform(0.0, 1.0) < 0.7 ? 0.15 : 0.8;
    c.Paint(c.RandomShape(p, r), tone, {0, 0}, 0.8);
  }
}

void Concrete(Canvas& c) {
  c.Fill(0.32);
  c.Add(c.Noise(1.2, 0.85), 0.2);
  c.Stains(0.7, 0.3, -0.35);
  c.Stains(0.3, 0.15, 0.25);
  for (int i = 0; i < c.Count(35.0); ++i) {
    const cv::Point2d p = c.Anywhere();
    c.Paint(c.RandomShape(p, c.Texels(c.Uniform(0.003, 0.014))), 0.1, {0, 0}, 0.8);
  }
  const double panel = c.Texels(1.2);
  for (double x = panel * c.Uniform(0.2, 0.9); x < c.width(); x += panel) {
    c.Paint(Canvas::Strip({x, 0}, {x, c.height()}, c.Texels(0.008)), 0.12, {0, 0}, 0.7);
    for (double y = 0.5 * panel; y < c.height(); y += panel) {
      c.Paint(Canvas::Ellipse({x + 0.2 * panel, y}, c.Texels(0.018), c.Texels(0.018), 0), 0.07);
    }
  }
  for (int i = 0; i < c.Count(0.3); ++i) c.Crack(c.Uniform(0.3, 1.2), 0.003, 0.08, 0.8);
}

void Bricks(Canvas& c) {
  c.image() = c.Noise(0.1, 0.9) * 0.16;
  c.Blocks({0.25, 0.08, 0.012, true, 0.0025, 0.38},
           [](double tone, double v) { return std::log(0.17) + 0.38 * tone - 0.08 * v; });
  c.Stains(1.2, 0.3, -0.3);
  c.Stains(0.5, 0.1, 0.5);
}

void Planks(Canvas& c) {
  const cv::Mat shades = c.Noise(0.5, 0.8);
  const cv::Mat grain = c.Noise(0.03, 0.85, 0.0, 14.0);
  c.image() = grain * 0.16 + shades * 0.08;
  c.Blocks({1.6, 0.14, 0.005, true, 0.0006, 0.04},
           [](double tone, double) { return std::log(0.26) + 0.3 * tone; });
  for (int i = 0; i < c.Count(3.0); ++i) {  // knots
    const cv::Point2d p = c.Anywhere();
    const double r = c.Texels(c.Uniform(0.006, 0.02));
    for (int ring = 3; ring >= 0; --ring) {
      c.Paint(Canvas::Ellipse(p, r * (1.0 + 0.5 * ring) * 1.5, r * (1.0 + 0.4 * ring), 0.0),
              ring % 2 == 0 ? 0.09 : 0.2,
              {0, 0},
              0.7);
    }
  }
  for (int i = 0; i < c.Count(2.0); ++i) c.Crack(c.Uniform(0.05, 0.3), 0.002, 0.5, 0.35);
}

void Tiles(Canvas& c) {
  // Veins lie where slow noise crosses zero.
  const cv::Mat veins = c.Noise(0.35, 0.75);
  c.image() = c.Noise(0.3, 0.85) * 0.06;
  for (int y = 0; y < veins.rows; ++y) {
    for (int x = 0; x < veins.cols; ++x) {
      const double near = std::exp(-std::abs(veins.at<float>(y, x)) * 14.0);
      c.image().at<float>(y, x) -= static_cast<float>(0.4 * near);
    }
  }
  c.Blocks({0.3, 0.3, 0.006, false, 0.0003, 0.12},
           [](double tone, double) { return std::log(0.42) + 0.25 * tone; });
  c.Stains(0.6, 0.2, -0.2);
}

void Carpet(Canvas& c) {
  c.image() = c.Noise(0.02, 1.0) * 0.18;
  c.Blocks({0.018, 0.012, 0.004, true, 0.001, 0.07},
           [](double tone, double) { return std::log(0.16) + 0.3 * tone; });
  const double border = c.Texels(0.12);
  for (int ring = 0; ring < 3; ++ring) {  // frames, one in the other
    const double inset = border * (0.4 + ring);
    const double w = c.width() - 2 * inset;
    const double h = c.height() - 2 * inset;
    if (w < border || h < border) break;
    const double tone = c.Uniform(0.05, 0.5);
    const double line = 0.3 * border;
    c.Paint(Canvas::Rectangle(inset, inset, w, line), tone, {0, 0}, 0.7);
    c.Paint(Canvas::Rectangle(inset, inset + h - line, w, line), tone, {0, 0}, 0.7);
    c.Paint(Canvas::Rectangle(inset, inset, line, h), tone, {0, 0}, 0.7);
    c.Paint(Canvas::Rectangle(inset + w - line, inset, line, h), tone, {0, 0}, 0.7);
  }
  for (int i = 0; i < c.Count(14.0); ++i) {  // ornaments
    const cv::Point2d p = c.Anywhere();
    const double tone = c.Uniform(0.04, 0.5);
    c.Paint(c.RandomShape(p, c.Texels(c.Uniform(0.03, 0.12))), tone, {0, 0}, 0.6);
  }
}

void Asphalt(Canvas& c) {
  c.Fill(0.14);
  c.Add(c.Noise(0.04, 1.0), 0.22);
  c.Add(c.Noise(2.0, 0.8, 0.1), 0.15);
  c.Stains(0.6, 0.2, -0.4);
  for (int i = 0; i < c.Count(0.25); ++i) {  // mended places
    const cv::Point2d p = c.Anywhere();
    const double w = c.Texels(c.Uniform(0.3, 1.0));
    c.Paint(Canvas::Rectangle(p.x, p.y, w, c.Texels(c.Uniform(0.2, 0.6))), 0.08, {0, 0}, 0.6);
  }
  for (int i = 0; i < c.Count(0.8); ++i) c.Crack(c.Uniform(0.5, 2.0), 0.006, 0.035, 0.8);
  for (int i = 0; i < c.Count(10.0); ++i) {  // leaves, gum, paper
    const cv::Point2d p = c.Anywhere();
    const double tone = c.Uniform(0.04, 0.5);
    c.Paint(c.RandomShape(p, c.Texels(c.Uniform(0.008, 0.035))), tone);
  }
  c.Add(c.Noise(0.015, 1.0), 0.1);
}

void Poster(Canvas& c) {
  c.Fill(c.Uniform(0.3, 0.7));
  const double size = std::min(c.width(), c.height()) / c.Texels(1.0);
  c.DeadLeaves(0.05 * size, 0.6 * size, 1.8, 0.04, 0.8, c.Whole());
  for (int i = 0; i < 2; ++i) {
    const double w = c.width() * c.Uniform(0.35, 0.7);
    const double h = c.height() * c.Uniform(0.12, 0.3);
    const double x = c.Uniform(0.05, 0.9) * (c.width() - w);
    const double y = c.Uniform(0.05, 0.95) * (c.height() - h);
    const bool dark = c.random().Below(2) == 0;
    c.Paint(Canvas::Rectangle(x, y, w, h), dark ? 0.08 : 0.7, {0, 0}, 0.9);
    c.Letters({x + 0.05 * w, y + 0.1 * h, 0.9 * w, 0.85 * h},
              std::max(4.0, h * c.Uniform(0.12, 0.4)),
              dark ? 0.7 : 0.06);
  }
  c.Add(c.Noise(size, 0.8), 0.08);
  const double rim = 0.025 * std::min(c.width(), c.height());
  c.Paint(Canvas::Rectangle(0, 0, c.width(), rim), 0.75);
  c.Paint(Canvas::Rectangle(0, c.height() - rim, c.width(), rim), 0.75);
  c.Paint(Canvas::Rectangle(0, 0, rim, c.height()), 0.75);
  c.Paint(Canvas::Rectangle(c.width() - rim, 0, rim, c.height()), 0.75);
}

void Books(Canvas& c) {
  c.Fill(0.03);
  for (double x = 0.0; x < c.width();) {
    const double w = c.Texels(c.Uniform(0.016, 0.06));
    const double top = c.height() * c.Uniform(0.02, 0.3);
    const double h = c.height() - top;
    const double tone = 0.04 * std::pow(18.0, c.Uniform(0.0, 1.0));
    const double lean = c.random().Below(8) == 0 ? 0.06 * c.height() : 0.0;
    // Rounded backs: darker towards the edges.
    const Polygon spine{{x + lean, top}, {x + w + lean, top}, {x + w, c.height()}, {x, c.height()}};
    c.Paint(spine, tone, {-0.5 / w, 0.0});
    c.Paint(Canvas::Strip({x + lean, top}, {x, c.height()}, 1.2), 0.02);
    const double ink = tone > 0.25 ? 0.05 : 0.6;
    if (c.random().Below(3) > 0) {
      const double y = top + h * c.Uniform(0.1, 0.3);
      const double letter = std::max(2.5, 0.5 * w);
      c.Letters({x + 0.22 * w + lean * 0.7, y, 0.75 * w, h * c.Uniform(0.2, 0.45)}, letter, ink);
    }
    for (std::uint64_t i = c.random().Below(4); i > 0; --i) {
      const double y = top + h * c.Uniform(0.05, 0.95);
      const double band_tone = c.Uniform(0.05, 0.6);
      c.Paint(Canvas::Rectangle(x, y, w, h * c.Uniform(0.01, 0.05)), band_tone);
    }
    x += w;
  }
  c.Add(c.Noise(0.2, 0.9), 0.1);
}

void Cardboard(Canvas& c) {
  c.Fill(0.3);
  c.Add(c.Noise(0.5, 0.8), 0.1);
  c.Add(c.Noise(0.006, 1.0, 0.0, 10.0), 0.04);
  c.Stains(0.3, 0.15, -0.25);
  const double x = c.width() * c.Uniform(0.3, 0.6);
  c.Paint(Canvas::Rectangle(x, 0, c.Texels(0.06), c.height()), 0.42, {0, 0}, 0.7);
  const double w = c.width() * c.Uniform(0.25, 0.45);
  const double h = c.height() * c.Uniform(0.2, 0.4);
  const double lx = c.Uniform(0.05, 0.5) * (c.width() - w);
  const double ly = c.Uniform(0.1, 0.9) * (c.height() - h);
  c.Paint(Canvas::Rectangle(lx, ly, w, h), 0.75);
  c.Letters({lx + 0.06 * w, ly + 0.1 * h, 0.88 * w, 0.5 * h}, std::max(4.0, 0.13 * h), 0.05);
  for (double bar = lx + 0.1 * w; bar < lx + 0.8 * w;) {  // a bar code
    const double thick = c.Uniform(0.006, 0.03) * w;
    c.Paint(Canvas::Rectangle(bar, ly + 0.68 * h, thick, 0.22 * h), 0.04);
    bar += thick + c.Uniform(0.008, 0.03) * w;
  }
  for (int i = 0; i < c.Count(30.0); ++i) {
    const cv::Point2d p = c.Anywhere();
    const double tone = c.Uniform(0.12, 0.5);
    c.Paint(c.RandomShape(p, c.Texels(c.Uniform(0.004, 0.02))), tone, {0, 0}, 0.6);
  }
  const cv::Rect2d print(0.05 * c.width(), 0.04 * c.height(), 0.6 * c.width(), 0.16 * c.height());
  c.Letters(print, std::max(5.0, 0.12 * c.height()), 0.07);
}

void Fabric(Canvas& c) {
  c.Fill(0.25);
  for (double y = 0.0; y < c.height();) {
    const double h = c.Texels(c.Uniform(0.03, 0.18));
    c.Paint(Canvas::Rectangle(0, y, c.width(), h), 0.06 * std::pow(10.0, c.Uniform(0.0, 1.0)));
    y += h;
  }
  const double size = std::min(c.width(), c.height()) / c.Texels(1.0);
  c.DeadLeaves(0.03 * size, 0.2 * size, 0.8, 0.04, 0.75, c.Whole());
  c.Add(c.Noise(0.5, 0.8), 0.1);
  c.Add(c.Noise(0.006, 1.0), 0.07);
}

void Foliage(Canvas& c) {
  c.Fill(0.03);
  for (int layer = 0; layer < 4; ++layer) {
    const int count = std::min(5000, c.Count(170.0));
    for (int i = 0; i < count; ++i) {
      const cv::Point2d p = c.Anywhere();
      const double length = c.Texels(c.Uniform(0.02, 0.07));
      const double angle = c.Uniform(0.0, kTurn);
      const double tone = 0.02 * std::pow(14.0, 0.22 * layer + c.Uniform(0.0, 0.35));
      c.Paint(Canvas::Ellipse(p, length, 0.4 * length, angle), tone, {0.3 / length, 0.0});
      const cv::Point2d rib(length * std::cos(angle), length * std::sin(angle));
      c.Paint(Canvas::Strip(p - rib, p + rib, 1.0), 1.5 * tone, {0, 0}, 0.5);
    }
  }
  c.Stains(0.7, 0.35, -0.8);
}

void Window(Canvas& c) {
  c.Fill(0.6);
  const double frame = std::max(3.0, 0.05 * std::min(c.width(), c.height()));
  const int columns = c.width() > c.height() ? 3 : 2;
  const int rows = c.height() > 1.4 * c.width() ? 3 : 2;
  const double w = (c.width() - frame) / columns;
  const double h = (c.height() - frame) / rows;
  for (int i = 0; i < columns * rows; ++i) {
    const double x = frame + w * (i % columns);
    const int row = i / columns;
    const double y = frame + h * row;
    c.Paint(Canvas::Rectangle(x, y, w - frame, h - frame), 0.07, {0.4 / w, -1.2 / h});
    // Objects behind the glass, and a curtain.
    for (int k = 0; k < 3; ++k) {
      const double px = x + c.Uniform(0.0, 0.6) * (w - frame);
      const double py = y + c.Uniform(0.2, 0.7) * (h - frame);
      c.Paint(Canvas::Rectangle(px, py, 0.3 * (w - frame), y + h - frame - py),
              c.Uniform(0.03, 0.25),
              {0, 0},
              0.6);
    }
    if (c.random().Below(3) == 0) {
      c.Paint(Canvas::Rectangle(x, y, c.Uniform(0.25, 0.6) * w, h - frame), 0.4, {1.5 / w, 0}, 0.8);
    }
  }
  c.Add(c.Noise(0.3, 0.8), 0.07);
}

void Door(Canvas& c) {
  c.Fill(0.2);
  c.Add(c.Noise(0.03, 0.85, 0.0, 0.2), 0.08);
  const double w = c.width();
  const double h = c.height();
  for (const double y : {0.06, 0.37, 0.68}) {
    for (const double x : {0.1, 0.54}) {
      c.Paint(Canvas::Rectangle(x * w, y * h, 0.36 * w, 0.26 * h), 0.1);
      c.Paint(Canvas::Rectangle((x + 0.015) * w, (y + 0.008) * h, 0.345 * w, 0.252 * h), 0.28);
      c.Paint(Canvas::Rectangle((x + 0.04) * w, (y + 0.02) * h, 0.28 * w, 0.22 * h), 0.19);
    }
  }
  c.Paint(Canvas::Ellipse({0.93 * w, 0.52 * h}, 0.022 * w, 0.022 * w, 0.0), 0.6);
  c.Paint(Canvas::Rectangle(0.82 * w, 0.515 * h, 0.12 * w, 0.01 * h), 0.5);
  c.Paint(Canvas::Rectangle(0.25 * w, 0.2 * h, 0.5 * w, 0.08 * h), 0.6);
  c.Letters({0.28 * w, 0.21 * h, 0.44 * w, 0.06 * h}, 0.03 * h, 0.05);
  c.Add(c.Noise(0.6, 0.8), 0.08);
}

void Metal(Canvas& c) {
  const double tone = c.Uniform(0.1, 0.5);
  c.Fill(tone);
  c.Add(c.Noise(1.0, 0.7), 0.06);
  c.Stains(0.35, 0.22, -0.6);
  c.Stains(0.12, 0.12, -0.5);
  const double panel = c.Texels(0.55);
  for (double x = 0.6 * panel; x < c.width(); x += panel) {
    c.Paint(Canvas::Strip({x, 0}, {x, c.height()}, c.Texels(0.006)), 0.03);
    c.Paint(Canvas::Strip({x + 3, 0}, {x + 3, c.height()}, 1.5), 1.6 * tone, {0, 0}, 0.6);
  }
  c.Paint(Canvas::Rectangle(0, 0.32 * c.height(), c.width(), 0.09 * c.height()),
          c.Uniform(0.05, 0.6));
  c.Letters({0.1 * c.width(), 0.5 * c.height(), 0.7 * c.width(), 0.3 * c.height()},
            std::max(5.0, 0.13 * c.height()),
            tone > 0.25 ? 0.05 : 0.6);
  for (int i = 0; i < c.Count(12.0); ++i) {
    const cv::Point2d p = c.Anywhere();
    const double tone = c.Uniform(0.05, 0.3);
    c.Paint(c.RandomShape(p, c.Texels(c.Uniform(0.005, 0.03))), tone, {0, 0}, 0.7);
  }
}

void Sky(Canvas& c) {
  c.Fill(0.5);
  c.Stains(12.0, 0.6, 0.35);
  c.Add(c.Noise(10.0, 0.6), 0.1);
}

using PaintMaterial = void (*)(Canvas&);

PaintMaterial Recipe(Material material) {
  switch (material) {
    case Material::kPlaster:
      return Plaster;
    case Material::kConcrete:
      return Concrete;
    case Material::kBricks:
      return Bricks;
    case Material::kPlanks:
      return Planks;
    case Material::kTiles:
      return Tiles;
    case Material::kCarpet:
      return Carpet;
    case Material::kAsphalt:
      return Asphalt;
    case Material::kPoster:
      return Poster;
    case Material::kBooks:
      return Books;
    case Material::kCardboard:
      return Cardboard;
    case Material::kFabric:
      return Fabric;
    case Material::kFoliage:
      return Foliage;
    case Material::kWindow:
      return Window;
    case Material::kDoor:
      return Door;
    case Material::kMetal:
      return Metal;
    case Material::kSky:
      return Sky;
  }
  ThrowError("no such material");
}

}  // namespace

cv::Mat MakeTexture(const TextureSpec& spec, RandomStream random) {
  Canvas canvas(spec, random);
  Recipe(spec.material)(canvas);
  // Stretched about a middle grey to the contrast of photographs.
  constexpr double kContrast = 1.3;
  const double middle = std::log(0.2);
  cv::Mat reflectance = kContrast * (canvas.image() - middle) + middle;
  cv::exp(reflectance, reflectance);
  reflectance *= spec.brightness;
  return cv::min(cv::max(reflectance, 0.015), 0.9);
}

}  // namespace cohort
