#include "datasets/render/texture.h"

#include <Eigen/Core>
#include <array>
#include <numbers>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "frontend/core/error.h"

namespace cohort {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;
using Polygon = std::vector<cv::Point2d>;  // [texels]

double SmoothStep(double from, double to, double x) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

// A texture in the making, as the logarithm of its reflectance: what lies on a surface (dirt,
// shades, worn paint) multiplies what is below.
class Canvas {
 public:
  Canvas(const TextureSpec& spec, RandomStream random)
      : texels_per_m_(spec.texels_per_m), random_(random) {
    const auto texels = [&](double metres) {
      return std::max(16, static_cast<int>(std::lround(metres * texels_per_m_)));
    };
    image_.create(texels(spec.height_m), texels(spec.width_m), CV_32FC1);
  }

  cv::Mat& image() { return image_; }
  double width() const { return image_.cols; }
  double height() const { return image_.rows; }
  double Texels(double metres) const { return metres * texels_per_m_; }
  RandomStream& random() { return random_; }
  double Uniform(double min, double max) { return random_.Uniform(min, max); }
  int Count(double per_square_metre) const {
    return static_cast<int>(
        std::lround(per_square_metre * width() * height() / (texels_per_m_ * texels_per_m_)));
  }

  void Fill(double reflectance) { image_.setTo(std::log(reflectance)); }

  // Smooth noise of unit variance: octaves from `coarsest_m` down to `finest_m`, each `falloff`
  // times as strong as the one before (1: as photographs are, 1/f). `stretch` makes it longer in x.
  cv::Mat Noise(double coarsest_m, double falloff, double finest_m = 0.0, double stretch = 1.0) {
    cv::Mat sum = cv::Mat::zeros(image_.size(), CV_32FC1);
    double variance = 0.0;
    double amplitude = 1.0;
    for (double cell = Texels(coarsest_m); cell >= std::max(4.0, Texels(finest_m)); cell *= 0.5) {
      const int cell_y = std::max(2, static_cast<int>(cell));
      const int cell_x = std::max(2, static_cast<int>(cell * stretch));
      cv::Mat lattice(image_.rows / cell_y + 3, image_.cols / cell_x + 3, CV_32FC1);
      for (int y = 0; y < lattice.rows; ++y) {
        for (int x = 0; x < lattice.cols; ++x) {
          lattice.at<float>(y, x) = static_cast<float>(random_.Gaussian());
        }
      }
      cv::Mat octave;
      cv::resize(lattice,
                 octave,
                 cv::Size(lattice.cols * cell_x, lattice.rows * cell_y),
                 0,
                 0,
                 cv::INTER_CUBIC);
      const cv::Rect part(
          static_cast<int>(random_.Below(static_cast<std::uint64_t>(cell_x))) + cell_x,
          static_cast<int>(random_.Below(static_cast<std::uint64_t>(cell_y))) + cell_y,
          image_.cols,
          image_.rows);
      cv::scaleAdd(octave(part), amplitude, sum, sum);
      variance += 0.5 * amplitude * amplitude;  // of cubic noise, about half the lattice's
      amplitude *= falloff;
    }
    if (variance > 0.0) sum *= 1.0 / std::sqrt(variance);
    return sum;
  }

  void Add(const cv::Mat& noise, double amount) { cv::scaleAdd(noise, amount, image_, image_); }

  // Paints a polygon, its edges smooth. `slope` is the change of the value from the polygon's
  // middle per texel, `cover` its opacity.
  void Paint(const Polygon& corners,
             double reflectance,
             cv::Point2d slope = {0.0, 0.0},
             double cover = 1.0) {
    cv::Point2d low(1e9, 1e9);
    cv::Point2d high(-1e9, -1e9);
    for (const cv::Point2d& p : corners) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
    const cv::Point2i first(static_cast<int>(std::floor(low.x)) - 1,
                            static_cast<int>(std::floor(low.y)) - 1);
    const cv::Point2i last(static_cast<int>(std::ceil(high.x)) + 2,
                           static_cast<int>(std::ceil(high.y)) + 2);
    const cv::Rect box = cv::Rect(first, last) & cv::Rect(0, 0, image_.cols, image_.rows);
    if (box.empty()) return;
    std::vector<cv::Point> fixed;  // 4 bits behind the point
    for (const cv::Point2d& p : corners) {
      fixed.emplace_back(static_cast<int>(std::lround(16.0 * (p.x - box.x))),
                         static_cast<int>(std::lround(16.0 * (p.y - box.y))));
    }
    cv::Mat mask = cv::Mat::zeros(box.size(), CV_8UC1);
    cv::fillPoly(mask, std::vector<std::vector<cv::Point>>{fixed}, cv::Scalar(255), cv::LINE_AA, 4);
    const double value = std::log(reflectance);
    const cv::Point2d middle = 0.5 * (low + high);
    for (int y = 0; y < box.height; ++y) {
      const std::uint8_t* m = mask.ptr<std::uint8_t>(y);
      float* row = image_.ptr<float>(box.y + y) + box.x;
      for (int x = 0; x < box.width; ++x) {
        if (m[x] == 0) continue;
        const double paint =
            value + slope.x * (box.x + x - middle.x) + slope.y * (box.y + y - middle.y);
        row[x] += static_cast<float>(cover * m[x] / 255.0 * (paint - row[x]));
      }
    }
  }

  static Polygon Rectangle(double x, double y, double width, double height) {
    return {{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}};
  }

  // A thin strip from a to b.
  static Polygon Strip(cv::Point2d a, cv::Point2d b, double width) {
    const cv::Point2d d = b - a;
    const double length = std::max(1e-9, std::hypot(d.x, d.y));
    const cv::Point2d n(-0.5 * width * d.y / length, 0.5 * width * d.x / length);
    return {a - n, b - n, b + n, a + n};
  }

  static Polygon Ellipse(cv::Point2d centre, double rx, double ry, double angle) {
    Polygon polygon;
    for (int i = 0; i < 28; ++i) {
      const double a = kTurn * i / 28.0;
      const double x = rx * std::cos(a);
      const double y = ry * std::sin(a);
      polygon.emplace_back(centre.x + x * std::cos(angle) - y * std::sin(angle),
                           centre.y + x * std::sin(angle) + y * std::cos(angle));
    }
    return polygon;
  }

  cv::Point2d Anywhere() {
    const double x = Uniform(0.0, width());
    return {x, Uniform(0.0, height())};
  }

  // Rectangles, ellipses and odd polygons.
  Polygon RandomShape(cv::Point2d centre, double radius) {
    const double angle = Uniform(0.0, kTurn);
    const double ratio = Uniform(0.4, 1.0);
    const std::uint64_t kind = random_.Below(4);
    if (kind == 0) return Ellipse(centre, radius, ratio * radius, angle);
    Polygon polygon;
    const int corners = kind == 1 ? 4 : 3 + static_cast<int>(random_.Below(5));
    for (int i = 0; i < corners; ++i) {
      const double a = angle + kTurn * (i + (kind == 1 ? 0.0 : Uniform(-0.3, 0.3))) / corners;
      const double r = kind == 1 ? radius : radius * Uniform(0.55, 1.0);
      polygon.emplace_back(centre.x + r * std::cos(a), centre.y + ratio * r * std::sin(a));
    }
    return polygon;
  }

  // Shapes over shapes with as many small ones as photographs have (radius density r^-3), `layers`
  // deep on average.
  void DeadLeaves(double least_m,
                  double most_m,
                  double layers,
                  double darkest,
                  double brightest,
                  const cv::Rect2d& part) {
    const double least = std::max(1.5, Texels(least_m));
    const double most = Texels(most_m);
    const double mean_area = 3.6 * least * least * std::log(std::max(1.5, most / least));
    const int count = static_cast<int>(std::min(6000.0, layers * part.area() / mean_area));
    for (int i = 0; i < count; ++i) {
      const double u = Uniform(0.0, 1.0 - (least / most) * (least / most));
      const double radius = least / std::sqrt(1.0 - u);
      const double x = part.x + Uniform(0.0, part.width);
      const double y = part.y + Uniform(0.0, part.height);
      const double slope = Uniform(-0.3, 0.3) / radius;
      const Polygon shape = RandomShape({x, y}, radius);
      Paint(shape, darkest * std::pow(brightest / darkest, Uniform(0.0, 1.0)), {slope, -slope});
    }
  }

  // Lines of what looks like letters.
  void Letters(const cv::Rect2d& part, double letter_height, double reflectance) {
    const double stroke = std::max(1.0, 0.16 * letter_height);
    for (double y = part.y; y + letter_height < part.y + part.height; y += 1.7 * letter_height) {
      const double end = part.x + part.width * Uniform(0.6, 1.0);
      for (double x = part.x; x + letter_height < end; x += 0.85 * letter_height) {
        if (random_.Below(6) == 0) continue;  // between words
        const double w = 0.55 * letter_height;
        const std::array<cv::Point2d, 6> node{{{x, y},
                                               {x + w, y},
                                               {x, y + 0.5 * letter_height},
                                               {x + w, y + 0.5 * letter_height},
                                               {x, y + letter_height},
                                               {x + w, y + letter_height}}};
        for (int i = 0; i < 3; ++i) {
          const std::size_t a = random_.Below(6);
          const std::size_t b = (a + 1 + random_.Below(5)) % 6;
          Paint(Strip(node[a], node[b], stroke), reflectance);
        }
      }
    }
  }

  // A wandering thin line.
  void Crack(double length_m, double width_m, double reflectance, double cover) {
    cv::Point2d p = Anywhere();
    double angle = Uniform(0.0, kTurn);
    const double step = std::max(3.0, Texels(0.03));
    for (double done = 0.0; done < Texels(length_m); done += step) {
      angle += Uniform(-0.6, 0.6);
      const cv::Point2d next = p + step * cv::Point2d(std::cos(angle), std::sin(angle));
      Paint(Strip(p, next, std::max(0.8, Texels(width_m))), reflectance, {0, 0}, cover);
      p = next;
    }
  }

  // Stains with soft borders: where slow noise is high.
  void Stains(double size_m, double share, double amount) {
    const cv::Mat noise = Noise(size_m, 0.6);
    const double threshold = 1.6 - 2.0 * share;
    for (int y = 0; y < image_.rows; ++y) {
      const float* n = noise.ptr<float>(y);
      float* row = image_.ptr<float>(y);
      for (int x = 0; x < image_.cols; ++x) {
        row[x] += static_cast<float>(amount * SmoothStep(threshold, threshold + 0.7, n[x]));
      }
    }
  }

  // Blocks in rows with joints between them. `paint(tone, noise, u, v)` gives a block's value:
  // tone is the block's own number (-1..1), u and v the place in it (0..1).
  template <typename PaintBlock>
  void Blocks(double block_width_m,
              double block_height_m,
              double joint_m,
              bool staggered,
              double unevenness_m,
              double joint_reflectance,
              const PaintBlock& paint) {
    const double block_w = Texels(block_width_m);
    const double block_h = Texels(block_height_m);
    const double joint = std::max(1.0, Texels(joint_m));
    const cv::Mat wobble_x = Noise(0.2, 0.7, 0.01);
    const cv::Mat wobble_y = Noise(0.2, 0.7, 0.01);
    const double wobble = Texels(unevenness_m);
    const int rows = static_cast<int>(height() / block_h) + 3;
    const int columns = static_cast<int>(width() / block_w) + 4;
    std::vector<double> tones(static_cast<std::size_t>(rows * columns));
    for (double& tone : tones) tone = Uniform(-1.0, 1.0);
    std::vector<double> shifts(static_cast<std::size_t>(rows), 0.0);
    for (int row = 0; staggered && row < rows; ++row) {
      shifts[static_cast<std::size_t>(row)] = block_w * (0.5 * (row % 2) + Uniform(-0.08, 0.08));
    }
    const double joint_value = std::log(joint_reflectance);
    for (int y = 0; y < image_.rows; ++y) {
      float* image_row = image_.ptr<float>(y);
      for (int x = 0; x < image_.cols; ++x) {
        const double v = y + block_h + wobble * wobble_y.at<float>(y, x);
        const int row = std::clamp(static_cast<int>(v / block_h), 0, rows - 1);
        const double u =
            x + block_w + shifts[static_cast<std::size_t>(row)] + wobble * wobble_x.at<float>(y, x);
        const int column = std::clamp(static_cast<int>(u / block_w), 0, columns - 1);
        const double in_u = u - column * block_w;
        const double in_v = v - row * block_h;
        const double to_joint =
            std::min(std::min(in_u, block_w - in_u), std::min(in_v, block_h - in_v)) - 0.5 * joint;
        const double cover = SmoothStep(-0.8, 0.8, to_joint);
        const double tone = tones[static_cast<std::size_t>(row * columns + column)];
        // Edges of blocks are worn and a little darker.
        const double worn = -0.15 * (1.0 - SmoothStep(0.0, 0.12 * block_h, to_joint));
        const double block = paint(tone, in_u / block_w, in_v / block_h) + worn;
        image_row[x] += static_cast<float>(joint_value + cover * (block - joint_value));
      }
    }
  }

 private:
  double texels_per_m_;
  RandomStream random_;
  cv::Mat image_;
};

cv::Rect2d Whole(const Canvas& c) { return {0.0, 0.0, c.width(), c.height()}; }

void Plaster(Canvas& c) {
  c.Fill(0.55);
  c.Add(c.Noise(1.5, 0.85, 0.02), 0.09);
  c.Stains(0.8, 0.15, -0.15);
  for (int i = 0; i < c.Count(0.25); ++i) c.Crack(c.Uniform(0.2, 1.0), 0.002, 0.2, 0.6);
  for (int i = 0; i < c.Count(1.0); ++i) {  // nail holes and scratches
    const cv::Point2d p = c.Anywhere();
    const double r = c.Texels(c.Uniform(0.003, 0.012));
    c.Paint(c.RandomShape(p, r), c.Uniform(0.0, 1.0) < 0.7 ? 0.15 : 0.8, {0, 0}, 0.8);
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
  c.Blocks(0.25, 0.08, 0.012, true, 0.0025, 0.38, [&](double tone, double, double v) {
    return std::log(0.17) + 0.38 * tone - 0.08 * v;
  });
  c.Stains(1.2, 0.3, -0.3);
  c.Stains(0.5, 0.1, 0.5);
}

void Planks(Canvas& c) {
  c.image() = c.Noise(0.03, 0.85, 0.0, 14.0) * 0.16 + c.Noise(0.5, 0.8) * 0.08;
  c.Blocks(1.6, 0.14, 0.005, true, 0.0006, 0.04, [&](double tone, double, double) {
    return std::log(0.26) + 0.3 * tone;
  });
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
  c.Blocks(0.3, 0.3, 0.006, false, 0.0003, 0.12, [&](double tone, double, double) {
    return std::log(0.42) + 0.25 * tone;
  });
  c.Stains(0.6, 0.2, -0.2);
}

void Carpet(Canvas& c) {
  c.image() = c.Noise(0.02, 1.0) * 0.18;
  c.Blocks(0.018, 0.012, 0.004, true, 0.001, 0.07, [&](double tone, double, double) {
    return std::log(0.16) + 0.3 * tone;
  });
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
    c.Paint(c.RandomShape(p, c.Texels(c.Uniform(0.03, 0.12))), c.Uniform(0.04, 0.5), {0, 0}, 0.6);
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
    c.Paint(c.RandomShape(p, c.Texels(c.Uniform(0.008, 0.035))), c.Uniform(0.04, 0.5));
  }
  c.Add(c.Noise(0.015, 1.0), 0.1);
}

void Poster(Canvas& c) {
  c.Fill(c.Uniform(0.3, 0.7));
  const double size = std::min(c.width(), c.height()) / c.Texels(1.0);
  c.DeadLeaves(0.05 * size, 0.6 * size, 1.8, 0.04, 0.8, Whole(c));
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
      c.Paint(Canvas::Rectangle(x, y, w, h * c.Uniform(0.01, 0.05)), c.Uniform(0.05, 0.6));
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
    c.Paint(c.RandomShape(p, c.Texels(c.Uniform(0.004, 0.02))), c.Uniform(0.12, 0.5), {0, 0}, 0.6);
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
  c.DeadLeaves(0.03 * size, 0.2 * size, 0.8, 0.04, 0.75, Whole(c));
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
    const double y = frame + h * (i / columns);
    c.Paint(Canvas::Rectangle(x, y, w - frame, h - frame), 0.07, {0.4 / w, -1.2 / h});
    // What stands behind the glass, and a curtain.
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
    c.Paint(c.RandomShape(p, c.Texels(c.Uniform(0.005, 0.03))), c.Uniform(0.05, 0.3), {0, 0}, 0.7);
  }
}

void Sky(Canvas& c) {
  c.Fill(0.5);
  c.Stains(12.0, 0.6, 0.35);
  c.Add(c.Noise(10.0, 0.6), 0.1);
}

}  // namespace

cv::Mat MakeTexture(const TextureSpec& spec, RandomStream random) {
  Canvas canvas(spec, random);
  switch (spec.material) {
    case Material::kPlaster:
      Plaster(canvas);
      break;
    case Material::kConcrete:
      Concrete(canvas);
      break;
    case Material::kBricks:
      Bricks(canvas);
      break;
    case Material::kPlanks:
      Planks(canvas);
      break;
    case Material::kTiles:
      Tiles(canvas);
      break;
    case Material::kCarpet:
      Carpet(canvas);
      break;
    case Material::kAsphalt:
      Asphalt(canvas);
      break;
    case Material::kPoster:
      Poster(canvas);
      break;
    case Material::kBooks:
      Books(canvas);
      break;
    case Material::kCardboard:
      Cardboard(canvas);
      break;
    case Material::kFabric:
      Fabric(canvas);
      break;
    case Material::kFoliage:
      Foliage(canvas);
      break;
    case Material::kWindow:
      Window(canvas);
      break;
    case Material::kDoor:
      Door(canvas);
      break;
    case Material::kMetal:
      Metal(canvas);
      break;
    case Material::kSky:
      Sky(canvas);
      break;
  }
  // Spread about a middle grey, to the contrast of photographs.
  constexpr double kContrast = 1.3;
  const double middle = std::log(0.2);
  cv::Mat reflectance = kContrast * (canvas.image() - middle) + middle;
  cv::exp(reflectance, reflectance);
  reflectance *= spec.brightness;
  return cv::min(cv::max(reflectance, 0.015), 0.9);
}

MipMap::MipMap(cv::Mat texture) {
  Check(texture.type() == CV_32FC1 && texture.cols >= 4 && texture.rows >= 4,
        "a texture is CV_32FC1, at least 4x4");
  levels_.emplace_back(texture);
  do {
    cv::Mat half;
    // Averages areas exactly also where a side is odd: nothing shifts.
    cv::resize(levels_.back().texels,
               half,
               cv::Size((levels_.back().texels.cols + 1) / 2, (levels_.back().texels.rows + 1) / 2),
               0,
               0,
               cv::INTER_AREA);
    levels_.emplace_back(half);
  } while (std::min(levels_.back().texels.cols, levels_.back().texels.rows) >= 4);
}

}  // namespace cohort
