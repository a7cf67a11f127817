#pragma once

#include <cmath>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <opencv2/core/types.hpp>
#include <vector>

#include "datasets/render/texture.h"
#include "frontend/core/random_stream.h"

namespace cohort {

using Polygon = std::vector<cv::Point2d>;  // [texels]

// A texture in progress, as the logarithm of its reflectance, because layers on a surface (dirt,
// shades, worn paint) multiply those below. Lengths in m are on the surface; lengths without unit
// are texels. If a call takes several random arguments, draw them into variables first.
class Canvas {
 public:
  Canvas(const TextureSpec& spec, RandomStream random);

  cv::Mat& image() { return image_; }
  double width() const { return image_.cols; }
  double height() const { return image_.rows; }
  cv::Rect2d Whole() const { return {0.0, 0.0, width(), height()}; }
  double Texels(double metres) const { return metres * texels_per_m_; }
  RandomStream& random() { return random_; }
  double Uniform(double min, double max) { return random_.Uniform(min, max); }
  int Count(double per_square_metre) const;
  cv::Point2d Anywhere();

  void Fill(double reflectance) { image_.setTo(std::log(reflectance)); }

  // Smooth noise of unit variance: octaves from `coarsest_m` down to `finest_m`, each `falloff`
  // times as strong as the one before (1: as in photographs, 1/f). `stretch` lengthens it in x.
  cv::Mat Noise(double coarsest_m, double falloff, double finest_m = 0.0, double stretch = 1.0);
  void Add(const cv::Mat& noise, double amount);

  // Paints a polygon with smooth edges. `slope` is the change of the value per texel from the
  // polygon's middle, `cover` its opacity.
  void Paint(const Polygon& corners,
             double reflectance,
             cv::Point2d slope = {0.0, 0.0},
             double cover = 1.0);

  static Polygon Rectangle(double x, double y, double width, double height);
  // A thin strip from a to b.
  static Polygon Strip(cv::Point2d a, cv::Point2d b, double width);
  static Polygon Ellipse(cv::Point2d centre, double rx, double ry, double angle);
  // Rectangles, ellipses and irregular polygons.
  Polygon RandomShape(cv::Point2d centre, double radius);

  // Overlapping shapes with as many small ones as in photographs (radius density r^-3), `layers`
  // deep on average.
  void DeadLeaves(double least_m,
                  double most_m,
                  double layers,
                  double darkest,
                  double brightest,
                  const cv::Rect2d& part);
  // Lines of letter-like shapes.
  void Letters(const cv::Rect2d& part, double letter_height, double reflectance);
  // A wandering thin line.
  void Crack(double length_m, double width_m, double reflectance, double cover);
  // Stains with soft borders, where slow noise is high.
  void Stains(double size_m, double share, double amount);

  // Blocks in rows with joints between them.
  struct BlockPattern {
    double width_m, height_m, joint_m;
    bool staggered;
    double unevenness_m;
    double joint_reflectance;
  };
  // A block's value: `tone` is the block's own number (-1..1), v the position in it, 0 its upper
  // edge.
  using BlockValue = std::function<double(double tone, double v)>;
  void Blocks(const BlockPattern& pattern, const BlockValue& value);

 private:
  double texels_per_m_;
  RandomStream random_;
  cv::Mat image_;
};

}  // namespace cohort
