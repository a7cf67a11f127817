#include "datasets/render/canvas.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/imgproc.hpp>

namespace cohort {
namespace {

double SmoothStep(double from, double to, double x) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

}  // namespace

Canvas::Canvas(const TextureSpec& spec, RandomStream random)
    : texels_per_m_(spec.texels_per_m), random_(random) {
  const auto texels = [&](double metres) {
    return std::max(16, static_cast<int>(std::lround(metres * texels_per_m_)));
  };
  image_.create(texels(spec.height_m), texels(spec.width_m), CV_32FC1);
}

int Canvas::Count(double per_square_metre) const {
  return static_cast<int>(
      std::lround(per_square_metre * width() * height() / (texels_per_m_ * texels_per_m_)));
}

cv::Point2d Canvas::Anywhere() {
  const double x = Uniform(0.0, width());
  return {x, Uniform(0.0, height())};
}

cv::Mat Canvas::Noise(double coarsest_m, double falloff, double finest_m, double stretch) {
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
    const auto below = [&](int n) {
      return static_cast<int>(random_.Below(static_cast<std::uint64_t>(n)));
    };
    const int top = below(cell_y) + cell_y;
    const int left = below(cell_x) + cell_x;
    const cv::Rect part(left, top, image_.cols, image_.rows);
    cv::scaleAdd(octave(part), amplitude, sum, sum);
    variance += 0.5 * amplitude * amplitude;  // of cubic noise, about half the lattice's
    amplitude *= falloff;
  }
  if (variance > 0.0) sum *= 1.0 / std::sqrt(variance);
  return sum;
}

void Canvas::Add(const cv::Mat& noise, double amount) {
  cv::scaleAdd(noise, amount, image_, image_);
}

void Canvas::Paint(const Polygon& corners, double reflectance, cv::Point2d slope, double cover) {
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
  std::vector<cv::Point> fixed;  // 4 fractional bits
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

Polygon Canvas::Rectangle(double x, double y, double width, double height) {
  return {{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}};
}

Polygon Canvas::Strip(cv::Point2d a, cv::Point2d b, double width) {
  const cv::Point2d d = b - a;
  const double length = std::max(1e-9, std::hypot(d.x, d.y));
  const cv::Point2d n(-0.5 * width * d.y / length, 0.5 * width * d.x / length);
  return {a - n, b - n, b + n, a + n};
}

Polygon Canvas::Ellipse(cv::Point2d centre, double rx, double ry, double angle) {
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

Polygon Canvas::RandomShape(cv::Point2d centre, double radius) {
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

void Canvas::DeadLeaves(double least_m,
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

void Canvas::Letters(const cv::Rect2d& part, double letter_height, double reflectance) {
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

void Canvas::Crack(double length_m, double width_m, double reflectance, double cover) {
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

void Canvas::Stains(double size_m, double share, double amount) {
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

void Canvas::Blocks(const BlockPattern& pattern, const BlockValue& value) {
  const double block_w = Texels(pattern.width_m);
  const double block_h = Texels(pattern.height_m);
  const double joint = std::max(1.0, Texels(pattern.joint_m));
  const cv::Mat wobble_x = Noise(0.2, 0.7, 0.01);
  const cv::Mat wobble_y = Noise(0.2, 0.7, 0.01);
  const double wobble = Texels(pattern.unevenness_m);
  const int rows = static_cast<int>(height() / block_h) + 3;
  const int columns = static_cast<int>(width() / block_w) + 4;
  std::vector<double> tones(static_cast<std::size_t>(rows * columns));
  for (double& tone : tones) tone = Uniform(-1.0, 1.0);
  std::vector<double> shifts(static_cast<std::size_t>(rows), 0.0);
  for (int row = 0; pattern.staggered && row < rows; ++row) {
    shifts[static_cast<std::size_t>(row)] = block_w * (0.5 * (row % 2) + Uniform(-0.08, 0.08));
  }
  const double joint_value = std::log(pattern.joint_reflectance);
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
      const double tone = tones[row * columns + column];
      // Edges of blocks are worn and a little darker.
      const double worn = -0.15 * (1.0 - SmoothStep(0.0, 0.12 * block_h, to_joint));
      const double block = value(tone, in_v / block_h) + worn;
      image_row[x] += static_cast<float>(joint_value + cover * (block - joint_value));
    }
  }
}

}  // namespace cohort
