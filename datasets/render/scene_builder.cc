#include "datasets/render/scene_builder.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

namespace cohort {
namespace {

using Eigen::Vector3d;

}  // namespace

class SceneBuilder::Shade {
 public:
  explicit Shade(SceneBuilder& builder) : builder_(builder), outer_(builder.shade_) {
    if (outer_ == 1.0) builder.shade_ = std::exp(builder.Uniform(-0.8, 0.8));
  }
  ~Shade() { builder_.shade_ = outer_; }
  Shade(const Shade&) = delete;
  Shade& operator=(const Shade&) = delete;

 private:
  SceneBuilder& builder_;
  double outer_;
};

void SceneBuilder::SetViewpoint(const Vector3d& centre,
                                const Vector3d& target,
                                double metres_per_frame) {
  design_.viewpoint = {centre, target, metres_per_frame};
}

void SceneBuilder::SetLamp(const Vector3d& lamp, double ambient) {
  design_.lamp = lamp;
  design_.ambient = ambient;
}

void SceneBuilder::Surface(
    Patch::Shape shape, int columns, int rows, const TextureSpec& texture, bool deforms) {
  Patch patch;
  patch.columns = columns;
  patch.rows = rows;
  patch.texture = texture;
  patch.texture.brightness *= shade_;
  patch.moves = deforms || motion_;
  if (motion_) {
    patch.x_in_world = [shape = std::move(shape), motion = motion_](
                           double s, double t, double frame) -> Vector3d {
      return motion(frame) * shape(s, t, frame);
    };
  } else {
    patch.x_in_world = std::move(shape);
  }
  design_.patches.push_back(std::move(patch));
}

void SceneBuilder::Quad(const Vector3d& corner,
                        const Vector3d& s,
                        const Vector3d& t,
                        Material material,
                        double brightness) {
  Surface(
      [=](double u, double v, double) -> Vector3d { return corner + u * s + v * t; },
      1,
      1,
      {.material = material, .width_m = s.norm(), .height_m = t.norm(), .brightness = brightness});
}

void SceneBuilder::Box(const Vector3d& base,
                       const Vector3d& size,
                       double angle,
                       Material sides,
                       Material top,
                       double brightness) {
  const Shade shade(*this);
  const Vector3d x = size.x() * Vector3d(std::cos(angle), 0, std::sin(angle));
  const Vector3d z = size.z() * Vector3d(-std::sin(angle), 0, std::cos(angle));
  const Vector3d down(0, size.y(), 0);
  const Vector3d near_left = base - 0.5 * x - 0.5 * z - down;
  Quad(near_left, x, down, sides, brightness);
  Quad(near_left + x, z, down, sides, brightness);
  Quad(near_left + x + z, -x, down, sides, brightness);
  Quad(near_left + z, -z, down, sides, brightness);
  Quad(near_left + z, x, -z, top, brightness);
  Quad(near_left + down, x, z, top, brightness);
}

void SceneBuilder::Cylinder(
    const Vector3d& base, double radius, double height, Material material, double brightness) {
  const Shade shade(*this);
  const auto around = [=](double s, double r, double y) -> Vector3d {
    return base + Vector3d(-r * std::sin(kTurn * s), y, r * std::cos(kTurn * s));
  };
  const auto texture = [&](double height_m) {
    return TextureSpec{.material = material,
                       .width_m = kTurn * radius,
                       .height_m = height_m,
                       .brightness = brightness};
  };
  constexpr int kColumns = 20;
  Surface([=](double s, double t, double) { return around(s, radius, (t - 1.0) * height); },
          kColumns,
          1,
          texture(height));
  Surface([=](double s, double t, double) { return around(s, t * radius, -height); },
          kColumns,
          1,
          texture(radius));
}

void SceneBuilder::Hall(double left,
                        double right,
                        double top,
                        double bottom,
                        double back,
                        Material walls,
                        Material floor,
                        Material end) {
  const double front = -3.0;
  const double depth = back - front;
  Quad({left, top, back}, {right - left, 0, 0}, {0, bottom - top, 0}, end);
  Quad({left, top, front}, {0, 0, depth}, {0, bottom - top, 0}, walls);
  Quad({right, top, back}, {0, 0, -depth}, {0, bottom - top, 0}, walls);
  Quad({left, bottom, back}, {right - left, 0, 0}, {0, 0, -depth}, floor);
  Quad({left, top, front}, {right - left, 0, 0}, {0, 0, depth}, Material::kPlaster, 1.3);
}

void SceneBuilder::Shelf(const Vector3d& upper_left, const Vector3d& size, int levels) {
  const double board = 0.03;
  const double x = upper_left.x();
  const double z = upper_left.z();
  const double bottom = upper_left.y() + size.y();
  const double step = (size.y() - 0.05) / levels;  // the lowest board lies over the floor
  const double wood = Uniform(0.5, 1.4);
  const auto plank = [&](const Vector3d& base, const Vector3d& plank_size) {
    Box(base, plank_size, 0.0, Material::kPlanks, Material::kPlanks, wood);
  };
  for (const double side : {0.0, size.x()}) {
    plank({x + side, bottom, z - 0.5 * size.z()}, {board, size.y(), size.z()});
  }
  Quad({x, upper_left.y(), z}, {size.x(), 0, 0}, {0, size.y(), 0}, Material::kPlanks, 0.5 * wood);
  for (int level = 0; level <= levels; ++level) {
    plank({x + 0.5 * size.x(), upper_left.y() + level * step + board, z - 0.5 * size.z()},
          {size.x(), board, size.z()});
    if (level == 0) continue;
    const double ground = upper_left.y() + level * step;
    for (double at = x + 0.05; at < x + size.x() - 0.2;) {
      const double room = x + size.x() - 0.03 - at;
      at += ThingOnBoard({at, ground, z}, room, step, size.z());
    }
  }
}

double SceneBuilder::ThingOnBoard(const Vector3d& left_back,
                                  double room,
                                  double step,
                                  double board_depth) {
  const double x = left_back.x();
  const double ground = left_back.y();
  const double z = left_back.z();
  const double height = step * Uniform(0.4, 0.85);
  if (Below(5) < 3) {  // books stand at the front edge or a little behind it
    const double width = std::min(room, Uniform(0.3, 0.8));
    const double setback = Uniform(0.03, 0.1);
    const double depth = 0.6 * board_depth;
    Box({x + 0.5 * width, ground, z - board_depth + setback + 0.5 * depth},
        {width, height, depth},
        0.0,
        Material::kBooks,
        Material::kCardboard);
    return width + Uniform(0.01, 0.2);
  }
  if (Below(3) == 0) {
    const double radius = std::min(0.4 * board_depth, Uniform(0.05, 0.12));
    const Material material = OneOf({Material::kFabric, Material::kMetal, Material::kPoster});
    const double setback = Uniform(0.45, 0.6);
    Cylinder({x + radius, ground, z - board_depth * setback}, radius, height, material);
    return 2.0 * radius + Uniform(0.02, 0.15);
  }
  const double width = std::min(room, Uniform(0.15, 0.4));
  const Material sides = OneOf({Material::kPoster, Material::kCardboard, Material::kMetal});
  const double angle = Uniform(-0.15, 0.15);
  Box({x + 0.5 * width, ground, z - 0.5 * board_depth},
      {0.85 * width, height, 0.6 * board_depth},
      angle,
      sides,
      Material::kCardboard);
  return width + Uniform(0.02, 0.2);
}

void SceneBuilder::Table(
    const Vector3d& base, double width, double depth, double height, double angle) {
  const double thick = 0.04;
  for (const double sx : {-0.45, 0.45}) {
    for (const double sz : {-0.42, 0.42}) {
      const double x = sx * width;
      const double z = sz * depth;
      Box(base + Vector3d(x * std::cos(angle) - z * std::sin(angle),
                          0,
                          x * std::sin(angle) + z * std::cos(angle)),
          {0.06, height - thick, 0.06},
          angle,
          Material::kPlanks);
    }
  }
  Box(base - Vector3d(0, height - thick, 0), {width, thick, depth}, angle, Material::kPlanks);
}

void SceneBuilder::Plant(const Vector3d& base, double height) {
  const double pot = 0.28 * height;
  Cylinder(base, 0.16 * height, pot, Material::kTiles, 0.8);
  for (int i = 0; i < 5; ++i) {  // leafy blades in all directions
    const double angle = kTurn * (i + Uniform(-0.3, 0.3)) / 5.0;
    const Vector3d out(std::cos(angle), 0, std::sin(angle));
    const double width = Uniform(0.3, 0.5) * height;
    const double lean = Uniform(0.05, 0.25) * height;
    Quad(base + Vector3d(0, -height, 0) + lean * out - 0.5 * width * out,
         width * out,
         Vector3d(0, height - pot, 0) - lean * out,
         Material::kFoliage);
  }
}

void SceneBuilder::Tree(const Vector3d& base, double height) {
  Cylinder(base, 0.13, 0.55 * height, Material::kAsphalt, 0.8);
  for (int i = 0; i < 6; ++i) {
    const double z = Uniform(-0.4, 0.4);
    const double y = -Uniform(0.45, 0.75) * height;
    const double x = Uniform(-0.4, 0.4);
    const double angle = Uniform(0.0, 3.0);
    const double depth = Uniform(0.6, 1.1);
    const double tall = Uniform(0.5, 0.9);
    const double width = Uniform(0.6, 1.1);
    Box(base + Vector3d(x, y, z), {width, tall, depth}, angle, Material::kFoliage);
  }
}

void SceneBuilder::Car(const Vector3d& base, double angle) {
  const auto at = [&](double x, double y, double z) -> Vector3d {
    return base + Vector3d(x * std::cos(angle) - z * std::sin(angle),
                           -y,
                           x * std::sin(angle) + z * std::cos(angle));
  };
  const double length = Uniform(3.4, 4.2);
  Box(at(0, 0.28, 0), {1.6, 0.6, length}, angle, Material::kMetal);
  Box(at(0, 0.88, 0.1), {1.4, 0.5, 0.55 * length}, angle, Material::kWindow, Material::kMetal);
  for (const double x : {-0.72, 0.72}) {
    for (const double z : {-0.32, 0.32}) {
      Box(at(x, 0.0, z * length),
          {0.2, 0.56, 0.56},
          angle,
          Material::kAsphalt,
          Material::kAsphalt,
          0.4);
    }
  }
}

void SceneBuilder::Opening(const Vector3d& upper_left,
                           const Vector3d& right,
                           double height,
                           const Vector3d& outward,
                           Material material) {
  Quad(upper_left + 0.03 * outward, right, {0, height, 0}, material);
  const Vector3d ledge = 0.14 * outward;
  const Vector3d low = upper_left + Vector3d(0, height, 0);
  Quad(low + ledge, right, {0, 0.08, 0}, Material::kConcrete, 1.6);
  Quad(low, right, ledge, Material::kConcrete, 1.8);
}

SceneDesign SceneBuilder::Finish() {
  const Viewpoint& view = design_.viewpoint;
  const double reach = 55.0 * view.metres_per_frame;
  for (Patch& patch : design_.patches) {
    double nearest = 1e9;
    for (const Vector3d& eye : {Vector3d(view.centre + Vector3d(-reach, 0, 0)),
                                Vector3d(view.centre + Vector3d(reach, 0, 0)),
                                Vector3d(view.centre + Vector3d(0, 0, reach))}) {
      for (int i = 0; i <= 64; ++i) {
        const int row = i / 8;
        const Vector3d x = patch.x_in_world((i % 8) / 7.0, row / 8.0, 0.0) - eye;
        // Inside the field of view, as far as this holds for every motion.
        if (x.z() < 0.5 || std::abs(x.x()) > 0.9 * x.z() || std::abs(x.y()) > 0.7 * x.z()) continue;
        nearest = std::min(nearest, x.norm());
      }
    }
    TextureSpec& spec = patch.texture;
    constexpr double kMaxTexels = 2.5e6;
    spec.texels_per_m = std::min(std::clamp(1.2 * focal_px_ / nearest, 24.0, 700.0),
                                 std::sqrt(kMaxTexels / (spec.width_m * spec.height_m)));
  }
  return std::move(design_);
}

}  // namespace cohort
