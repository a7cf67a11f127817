#include "datasets/render/scene_design.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

using Eigen::Vector3d;
constexpr double kTurn = 2.0 * std::numbers::pi;

// world_from_rest of a body in a frame.
using BodyMotion = std::function<Rigid3(double frame)>;

// World: x right, y down, z ahead; metres. The camera starts near the origin.
class Builder {
 public:
  Builder(unsigned seed, double focal_px) : random_(seed, "scene/layout"), focal_px_(focal_px) {}

  double Uniform(double min, double max) { return random_.Uniform(min, max); }
  std::uint64_t Below(std::uint64_t n) { return random_.Below(n); }
  Material OneOf(std::initializer_list<Material> materials) {
    return materials.begin()[random_.Below(materials.size())];
  }

  void SetViewpoint(const Vector3d& centre, const Vector3d& target, double metres_per_frame) {
    design_.viewpoint = {centre, target, metres_per_frame};
  }
  void SetLamp(const Vector3d& lamp, double ambient) {
    design_.lamp = lamp;
    design_.ambient = ambient;
  }
  // What is added while it is set moves so.
  void SetMotion(BodyMotion motion) { motion_ = std::move(motion); }

  // Things of one kind are of many shades.
  class Shade {
   public:
    explicit Shade(Builder& builder) : builder_(builder), outer_(builder.shade_) {
      if (outer_ == 1.0) builder.shade_ = std::exp(builder.Uniform(-0.8, 0.8));
    }
    ~Shade() { builder_.shade_ = outer_; }

   private:
    Builder& builder_;
    double outer_;
  };

  // A parallelogram seen from its front: `corner` is its upper left, `s` points right, `t` down.
  void Quad(const Vector3d& corner,
            const Vector3d& s,
            const Vector3d& t,
            Material material,
            double brightness = 1.0) {
    Add([=](double u, double v, double) -> Vector3d { return corner + u * s + v * t; },
        1,
        1,
        s.norm(),
        t.norm(),
        material,
        brightness);
  }

  // A box standing on `base` (the middle of its underside), turned about the vertical.
  void Box(const Vector3d& base,
           const Vector3d& size,
           double angle,
           Material sides,
           Material top,
           double brightness = 1.0) {
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
  void Box(const Vector3d& base, const Vector3d& size, double angle, Material material) {
    Box(base, size, angle, material, material);
  }

  // Upright, on the middle of its underside, closed on top.
  void Cylinder(const Vector3d& base,
                double radius,
                double height,
                Material material,
                double brightness = 1.0) {
    const Shade shade(*this);
    const auto around = [=](double s, double r, double y) -> Vector3d {
      return base + Vector3d(-r * std::sin(kTurn * s), y, r * std::cos(kTurn * s));
    };
    Add([=](double s, double t, double) { return around(s, radius, (t - 1.0) * height); },
        20,
        1,
        kTurn * radius,
        height,
        material,
        brightness);
    Add([=](double s, double t, double) { return around(s, t * radius, -height); },
        20,
        1,
        kTurn * radius,
        radius,
        material,
        brightness);
  }

  // Floor, ceiling, back and side walls, open behind the camera.
  void Hall(double left,
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

  // An open cupboard with its back at `corner.z`: boards every `step` m, filled with things.
  void Shelf(const Vector3d& upper_left, const Vector3d& size, int levels) {
    const double board = 0.03;
    const double x = upper_left.x();
    const double z = upper_left.z();
    const double bottom = upper_left.y() + size.y();
    const double step = (size.y() - 0.05) / levels;  // the lowest board lies over the floor
    const double wood = Uniform(0.5, 1.4);
    for (const double side : {0.0, size.x()}) {
      Box({x + side, bottom, z - 0.5 * size.z()},
          {board, size.y(), size.z()},
          0.0,
          Material::kPlanks,
          Material::kPlanks,
          wood);
    }
    Quad({x, upper_left.y(), z}, {size.x(), 0, 0}, {0, size.y(), 0}, Material::kPlanks, 0.5 * wood);
    for (int level = 0; level <= levels; ++level) {
      Box({x + 0.5 * size.x(), upper_left.y() + level * step + board, z - 0.5 * size.z()},
          {size.x(), board, size.z()},
          0.0,
          Material::kPlanks,
          Material::kPlanks,
          wood);
      if (level == 0) continue;
      const double ground = upper_left.y() + level * step;
      for (double at = x + 0.05; at < x + size.x() - 0.2;) {
        const double room = x + size.x() - 0.03 - at;
        const double height = step * Uniform(0.4, 0.85);
        if (Below(5) < 3) {  // books stand at the front edge or a little behind it
          const double width = std::min(room, Uniform(0.3, 0.8));
          const double setback = Uniform(0.03, 0.1);
          const double depth = 0.6 * size.z();
          Box({at + 0.5 * width, ground, z - size.z() + setback + 0.5 * depth},
              {width, height, depth},
              0.0,
              Material::kBooks,
              Material::kCardboard);
          at += width + Uniform(0.01, 0.2);
        } else if (Below(3) == 0) {
          const double radius = std::min(0.4 * size.z(), Uniform(0.05, 0.12));
          Cylinder({at + radius, ground, z - size.z() * Uniform(0.45, 0.6)},
                   radius,
                   height,
                   OneOf({Material::kFabric, Material::kMetal, Material::kPoster}));
          at += 2.0 * radius + Uniform(0.02, 0.15);
        } else {
          const double width = std::min(room, Uniform(0.15, 0.4));
          Box({at + 0.5 * width, ground, z - 0.5 * size.z()},
              {0.85 * width, height, 0.6 * size.z()},
              Uniform(-0.15, 0.15),
              OneOf({Material::kPoster, Material::kCardboard, Material::kMetal}),
              Material::kCardboard);
          at += width + Uniform(0.02, 0.2);
        }
      }
    }
  }

  void Table(const Vector3d& base, double width, double depth, double height, double angle) {
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

  void Plant(const Vector3d& base, double height) {
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

  void Tree(const Vector3d& base, double height) {
    Cylinder(base, 0.13, 0.55 * height, Material::kAsphalt, 0.8);
    for (int i = 0; i < 6; ++i) {
      const Vector3d at =
          base + Vector3d(Uniform(-0.4, 0.4), -Uniform(0.45, 0.75) * height, Uniform(-0.4, 0.4));
      Box(at,
          Vector3d(Uniform(0.6, 1.1), Uniform(0.5, 0.9), Uniform(0.6, 1.1)),
          Uniform(0.0, 3.0),
          Material::kFoliage);
    }
  }

  void Car(const Vector3d& base, double angle) {
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

  // On a wall: a window or door with its sill.
  void Opening(const Vector3d& upper_left,
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

  SceneDesign Finish();

 private:
  void Add(Patch::Shape shape,
           int columns,
           int rows,
           double width_m,
           double height_m,
           Material material,
           double brightness) {
    Patch patch;
    patch.columns = columns;
    patch.rows = rows;
    patch.texture.material = material;
    patch.texture.width_m = width_m;
    patch.texture.height_m = height_m;
    patch.texture.brightness = brightness * shade_;
    patch.moves = static_cast<bool>(motion_);
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
  friend void AddCloth(Builder&);

  RandomStream random_;
  double focal_px_;
  BodyMotion motion_;
  double shade_ = 1.0;  // of the thing that is being added
  SceneDesign design_;
};

// As many texels as pixels see the surface from near the path, within what memory allows.
SceneDesign Builder::Finish() {
  const Viewpoint& view = design_.viewpoint;
  const double reach = 55.0 * view.metres_per_frame;
  for (Patch& patch : design_.patches) {
    double nearest = 1e9;
    for (const Vector3d& eye : {Vector3d(view.centre + Vector3d(-reach, 0, 0)),
                                Vector3d(view.centre + Vector3d(reach, 0, 0)),
                                Vector3d(view.centre + Vector3d(0, 0, reach))}) {
      for (int i = 0; i <= 64; ++i) {
        const Vector3d x = patch.x_in_world((i % 8) / 7.0, (i / 8) / 8.0, 0.0) - eye;
        // Inside the field of view, as far as that can be said for every motion.
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

void RoomShell(Builder& b, double metres_per_frame) {
  b.SetViewpoint({0, -0.1, 0}, {0, 0.35, 4.6}, metres_per_frame);
  b.SetLamp({-0.6, -1.1, 3.0}, 0.3);
  b.Hall(-3.7, 3.9, -1.35, 1.4, 7.2, Material::kPlaster, Material::kPlanks, Material::kPlaster);
  // Skirting boards and a carpet.
  b.Quad({-3.7, 1.3, 7.17}, {7.6, 0, 0}, {0, 0.1, 0}, Material::kPlanks, 1.4);
  b.Quad({-3.67, 1.3, -3}, {0, 0, 10.2}, {0, 0.1, 0}, Material::kPlanks, 1.4);
  b.Quad({3.87, 1.3, 7.2}, {0, 0, -10.2}, {0, 0.1, 0}, Material::kPlanks, 1.4);
  b.Quad({b.Uniform(-1.9, -1.3), 1.39, 5.9}, {3.2, 0, 0.2}, {0.15, 0, -2.3}, Material::kCarpet);
}

void RoomWalls(Builder& b) {
  b.Opening({-3.7, -0.9, 4.1}, {0, 0, 1.7}, 1.4, {1, 0, 0}, Material::kWindow);
  b.Opening({3.9, -0.75, 4.9}, {0, 0, -0.95}, 2.1, {-1, 0, 0}, Material::kDoor);
  for (int i = 0; i < 2; ++i) {
    const double width = b.Uniform(0.6, 1.0);
    b.Quad({3.87, b.Uniform(-0.9, -0.6), 6.7 - 3.1 * i},
           {0, 0, -width},
           {0, b.Uniform(0.6, 0.9), 0},
           Material::kPoster);
  }
  for (int i = 0; i < 4; ++i) {
    b.Quad({-1.15 + 1.25 * i + b.Uniform(-0.1, 0.1), b.Uniform(-1.1, -0.8), 7.17},
           {b.Uniform(0.6, 1.0), 0, 0},
           {0, b.Uniform(0.6, 1.1), 0},
           Material::kPoster);
  }
}

void Room(Builder& b) {
  RoomShell(b, 0.023);
  RoomWalls(b);
  b.Shelf({-3.3, -0.9, 7.15}, {1.9, 2.3, 0.4}, 5);
  // A sofa along the back wall.
  const double sofa = b.Uniform(0.5, 1.0);
  b.Box({sofa + 1.0, 1.4, 6.55}, {2.2, 0.45, 0.9}, 0.0, Material::kFabric);
  b.Box({sofa + 1.0, 0.95, 6.9}, {2.2, 0.5, 0.2}, 0.0, Material::kFabric);
  b.Box({sofa - 0.2, 1.4, 6.55}, {0.22, 0.65, 0.9}, 0.0, Material::kFabric);
  b.Box({sofa + 2.2, 1.4, 6.55}, {0.22, 0.65, 0.9}, 0.0, Material::kFabric);
  // A table with things on it, chairs of boxes about it.
  const Vector3d table(b.Uniform(-0.4, 0.3), 1.4, b.Uniform(4.5, 4.9));
  b.Table(table, 1.5, 0.9, 0.74, b.Uniform(-0.3, 0.3));
  for (int i = 0; i < 5; ++i) {
    b.Box(table + Vector3d(-0.52 + 0.26 * i, -0.74, b.Uniform(-0.25, 0.25)),
          {b.Uniform(0.1, 0.22), b.Uniform(0.08, 0.35), b.Uniform(0.1, 0.22)},
          b.Uniform(-0.8, 0.8),
          b.OneOf({Material::kPoster, Material::kCardboard, Material::kFabric}));
  }
  b.Plant({-2.9, 1.4, b.Uniform(5.2, 5.6)}, b.Uniform(1.2, 1.5));
  b.Box({b.Uniform(2.4, 2.8), 1.4, 4.6}, {0.9, b.Uniform(0.8, 1.1), 0.5}, 0.3, Material::kPlanks);
  b.Box({2.6, 0.55, 4.6}, {0.4, 0.5, 0.3}, b.Uniform(0.0, 0.6), Material::kPoster);
  // In front: removal boxes left, a chest and a lamp right.
  b.Box({-1.75, 1.4, 3.1}, {0.7, 0.55, 0.6}, b.Uniform(0.1, 0.5), Material::kCardboard);
  b.Box({-1.7, 0.85, 3.1}, {0.5, 0.4, 0.45}, b.Uniform(-0.4, 0.4), Material::kCardboard);
  b.Box({1.75, 1.4, 2.9}, {0.55, b.Uniform(0.85, 1.05), 0.5}, -0.3, Material::kPoster);
  b.Cylinder({1.25, 1.4, 3.6}, 0.03, 1.9, Material::kMetal);
  b.Cylinder({1.25, -0.3, 3.6}, 0.2, 0.32, Material::kFabric, 1.5);
}

void Corridor(Builder& b) {
  b.SetViewpoint({0, 0, 0}, {0.1, 0.05, 5.0}, 0.018);
  b.SetLamp({0.1, -1.0, 4.5}, 0.3);
  b.Hall(-1.95, 2.05, -1.25, 1.4, 11.5, Material::kConcrete, Material::kTiles, Material::kBricks);
  for (const double side : {-1.0, 1.0}) {
    const double wall = side < 0 ? -1.95 : 2.05;
    const Vector3d inward(-side, 0, 0);
    const Vector3d right(0, 0, side < 0 ? 1.0 : -1.0);
    const double first = b.Uniform(1.6, 2.3);
    for (int i = 0; i < 5; ++i) {
      const double z = first + 2.1 * i;
      b.Opening({wall, -0.7, z}, 0.9 * right, 2.1, inward, Material::kDoor);
      const double w = b.Uniform(0.4, 0.7);
      b.Quad({wall - 0.03 * side, b.Uniform(-0.7, -0.4), z + 1.05},
             w * right,
             {0, b.Uniform(0.5, 0.8), 0},
             Material::kPoster);
      // Pillars before the wall.
      b.Box({wall - 0.1 * side, 1.4, z - 0.55 + (side > 0 ? 0.3 : 0.0)},
            {0.2, 2.65, 0.3},
            0.0,
            Material::kBricks);
    }
    for (int i = 0; i < 5; ++i) {
      const double z = 2.9 + 1.7 * i + b.Uniform(-0.3, 0.3);
      const double height = b.Uniform(0.5, 1.1);
      const Vector3d base(wall - side * b.Uniform(0.4, 0.6), 1.4, z);
      b.Box(base,
            {b.Uniform(0.4, 0.6), height, b.Uniform(0.4, 0.6)},
            b.Uniform(-0.3, 0.3),
            b.OneOf({Material::kCardboard, Material::kPoster, Material::kMetal}));
      if (b.Below(2) == 0) {
        b.Box(base - Vector3d(0, height, 0),
              {0.35, b.Uniform(0.25, 0.5), 0.35},
              b.Uniform(-0.5, 0.5),
              b.OneOf({Material::kCardboard, Material::kFabric}));
      }
    }
  }
  for (int i = 0; i < 4; ++i) {  // lamps and a duct under the ceiling
    b.Box({0.1, -1.15, 2.6 + 2.4 * i},
          {0.9, 0.08, 0.25},
          0.0,
          Material::kPlaster,
          Material::kPlaster,
          1.6);
  }
  b.Box({-1.5, -0.9, 4.2}, {0.35, 0.3, 14.0}, 0.0, Material::kMetal);
  b.Opening({-0.45, -0.7, 11.5}, {1.0, 0, 0}, 2.1, {0, 0, -1}, Material::kDoor);
  b.Quad({0.8, -0.6, 11.47}, {0.9, 0, 0}, {0, 0.9, 0}, Material::kPoster);
  b.Box({b.Uniform(0.5, 0.8), 1.4, 7.3}, {0.5, 0.9, 0.5}, 0.4, Material::kPoster);
}

void House(Builder& b, double x, double z, double length, double side, Material wall, double top) {
  // `side` -1: left of the street, looking right.
  const Vector3d outward(-side, 0, 0);
  const Vector3d right(0, 0, side < 0 ? 1.0 : -1.0);
  const double start = side < 0 ? z : z + length;
  b.Quad({x, top, start}, length * right, {0, 1.6 - top, 0}, wall);
  // The end that faces the camera.
  b.Quad({side < 0 ? x - 4.0 : x, top, z}, {4.0, 0, 0}, {0, 1.6 - top, 0}, wall);
  const int columns = std::max(1, static_cast<int>(length / 1.5));
  const double pitch = length / columns;
  for (int column = 0; column < columns; ++column) {
    const Vector3d at = Vector3d(x, 0, start) + (0.22 + column) * pitch * right;
    for (int row = 0; row < 3; ++row) {
      const bool door = row == 0 && column % 3 == 1;
      const Vector3d corner(at.x(), door ? -0.55 : -0.4 - 1.75 * row, at.z());
      b.Opening(corner,
                0.55 * pitch * right,
                door ? 2.1 : 1.15,
                outward,
                door ? Material::kDoor : Material::kWindow);
    }
  }
  b.Box({x - 0.12 * side, -1.15, z + 0.5 * length}, {0.25, 0.12, length}, 0.0, Material::kConcrete);
}

void Street(Builder& b) {
  b.SetViewpoint({0, 0, 0}, {0.1, -0.1, 6.0}, 0.026);
  b.SetLamp({-9.0, -22.0, -8.0}, 0.3);
  const double left = -3.8;
  const double right = 4.2;
  b.Quad({-6, 1.72, 13.0}, {12, 0, 0}, {0, 0, -15}, Material::kAsphalt);
  b.Box({left + 0.45, 1.72, 5.5}, {2.1, 0.12, 15.0}, 0.0, Material::kTiles);
  b.Box({right - 0.45, 1.72, 5.5}, {2.1, 0.12, 15.0}, 0.0, Material::kTiles);
  b.Quad({-60, -45, 45}, {120, 0, 0}, {0, 60, 0}, Material::kSky);
  double z_left = 1.5;
  double z_right = 1.0;
  for (int i = 0; i < 4; ++i) {
    const double length_left = b.Uniform(2.6, 3.6);
    const double length_right = b.Uniform(2.6, 3.6);
    House(b,
          left - b.Uniform(0.0, 0.5),
          z_left,
          length_left,
          -1.0,
          i % 2 ? Material::kConcrete : Material::kBricks,
          b.Uniform(-6.0, -4.0));
    House(b,
          right + b.Uniform(0.0, 0.5),
          z_right,
          length_right,
          1.0,
          i % 2 ? Material::kBricks : Material::kPlaster,
          b.Uniform(-6.0, -4.0));
    z_left += length_left;
    z_right += length_right;
  }
  // The end of the street: a house across, trees before it.
  b.Quad({-6, -3.6, 12.8}, {12, 0, 0}, {0, 5.4, 0}, Material::kBricks, 1.3);
  for (int column = 0; column < 5; ++column) {
    for (int row = 0; row < 2; ++row) {
      b.Opening({-3.4 + 1.5 * column, -0.6 - 1.7 * row, 12.8},
                {0.9, 0, 0},
                1.1,
                {0, 0, -1},
                Material::kWindow);
    }
  }
  b.Tree({-1.9, 1.6, b.Uniform(9.5, 10.5)}, 2.8);
  b.Tree({2.6, 1.6, b.Uniform(8.6, 9.6)}, 2.6);
  b.Car({-1.85, 1.72, b.Uniform(6.2, 6.8)}, b.Uniform(-0.06, 0.06));
  b.Car({2.15, 1.72, b.Uniform(5.2, 6.0)}, b.Uniform(-0.06, 0.06));
  for (int i = 0; i < 3; ++i) {  // posts, bins and a sign near by
    b.Cylinder({left + 1.35, 1.6, 2.9 + 2.4 * i}, 0.07, 3.4, Material::kMetal);
    b.Box({right - b.Uniform(1.0, 1.3), 1.6, 3.0 + 2.2 * i},
          {b.Uniform(0.4, 0.6), b.Uniform(0.7, 1.1), b.Uniform(0.4, 0.6)},
          b.Uniform(-0.3, 0.3),
          b.OneOf({Material::kMetal, Material::kPoster, Material::kCardboard}));
  }
  b.Quad({left + 1.0, -0.7, 5.25}, {0.7, 0, 0.05}, {0, 0.55, 0}, Material::kPoster);
  b.Box({-1.55, 1.72, 3.2}, {0.5, b.Uniform(0.6, 0.8), 0.5}, 0.5, Material::kPoster);
}

void Tabletop(Builder& b) {
  b.SetViewpoint({0, -0.25, 0}, {0.05, 0.4, 2.9}, 0.0145);
  b.SetLamp({-1.4, -1.4, 1.6}, 0.3);
  b.Hall(-3.4, 3.4, -1.6, 1.3, 5.2, Material::kPlaster, Material::kPlanks, Material::kBricks);
  b.Opening({-1.7, -1.1, 5.2}, {1.3, 0, 0}, 1.1, {0, 0, -1}, Material::kWindow);
  b.Quad({0.3, -1.0, 5.17}, {0.8, 0, 0}, {0, 0.95, 0}, Material::kPoster);
  b.Quad({1.4, -0.8, 5.17}, {0.7, 0, 0}, {0, 0.6, 0}, Material::kPoster);
  const double y = 0.6;
  b.Box({0.0, y + 0.06, 3.0}, {4.4, 0.06, 2.5}, b.Uniform(-0.04, 0.04), Material::kPlanks);
  b.Quad({-1.0, y - 0.004, 3.5}, {1.6, 0, 0.2}, {-0.1, 0, -1.1}, Material::kCarpet);
  // Things on a loose grid, small ones in front.
  for (int row = 0; row < 4; ++row) {
    const double z = 2.1 + 0.55 * row;
    for (int i = 0; i < 6; ++i) {
      if (b.Below(7) == 0) continue;
      const Vector3d at(
          (-0.85 + 0.34 * i + b.Uniform(-0.07, 0.07)) * 0.62 * z, y, z + b.Uniform(-0.12, 0.12));
      const double size = 0.11 + 0.05 * row;
      switch (b.Below(5)) {
        case 0:
          b.Cylinder(at,
                     0.35 * size,
                     b.Uniform(0.8, 1.8) * size,
                     b.OneOf({Material::kFabric, Material::kPoster, Material::kMetal}));
          break;
        case 1: {  // a pile of books
          double height = 0.0;
          for (int book = 0; book < 4; ++book) {
            const double thick = b.Uniform(0.02, 0.05);
            b.Box(at - Vector3d(0, height, 0),
                  {1.5 * size, thick, 1.1 * size},
                  b.Uniform(-0.5, 0.5),
                  b.OneOf({Material::kBooks, Material::kFabric}),
                  Material::kPoster);
            height += thick;
          }
          break;
        }
        case 2:
          b.Plant(at, 2.2 * size);
          break;
        default:
          b.Box(
              at,
              {b.Uniform(0.6, 1.3) * size, b.Uniform(0.7, 2.0) * size, b.Uniform(0.6, 1.0) * size},
              b.Uniform(-0.8, 0.8),
              b.OneOf(
                  {Material::kPoster, Material::kCardboard, Material::kPoster, Material::kPlanks}));
          break;
      }
    }
  }
}

void Facade(Builder& b) {
  b.SetViewpoint({0, 0, 0}, {0.2, -0.3, 6.0}, 0.025);
  b.SetLamp({9.0, -20.0, -12.0}, 0.3);
  const double slant = b.Uniform(0.03, 0.09);
  const auto wall = [&](double x) { return 6.3 + slant * x; };
  const Vector3d right(1, 0, slant);
  const Vector3d out(slant, 0, -1);
  b.Quad({-8, -7, wall(-8)}, 16 * right, {0, 8.6, 0}, Material::kBricks);
  b.Quad({-9, 1.6, 8}, {18, 0, 0}, {0, 0, -10}, Material::kTiles);
  for (int column = 0; column < 7; ++column) {
    const double x = -5.6 + 1.75 * column + b.Uniform(-0.12, 0.12);
    const Vector3d at(x, 0, wall(x));
    for (int row = 0; row < 3; ++row) {
      const double y = -0.75 - 2.15 * row;
      const bool door = row == 0 && column % 4 == 2;
      b.Opening(at + Vector3d(0, door ? -0.7 : y, 0),
                0.95 * right,
                door ? 2.2 : 1.35,
                out,
                door ? Material::kDoor : Material::kWindow);
      if (door) {
        b.Box(at + 0.5 * right + 0.45 * out + Vector3d(0, 1.6, 0),
              {1.5, 0.14, 0.9},
              slant,
              Material::kConcrete);
      }
      if (row == 1 && column % 2 == 0) {  // a balcony
        b.Box(at + 0.48 * right + 0.5 * out + Vector3d(0, -1.35, 0),
              {1.5, 0.12, 1.0},
              slant,
              Material::kConcrete);
        b.Box(at + 0.48 * right + 0.97 * out + Vector3d(0, -1.47, 0),
              {1.5, 0.75, 0.06},
              slant,
              b.OneOf({Material::kMetal, Material::kFabric, Material::kPlanks}));
      }
    }
    if (column % 3 == 0) {  // a pillar or a pipe
      b.Box(at + -0.45 * right + 0.12 * out + Vector3d(0, 1.6, 0),
            {0.35, 8.2, 0.3},
            slant,
            Material::kConcrete);
    } else if (column % 3 == 1) {
      b.Cylinder(at + -0.4 * right + 0.1 * out + Vector3d(0, 1.6, 0), 0.06, 8.2, Material::kMetal);
    }
  }
  b.Box(Vector3d(0, -1.9, wall(0)) + 0.08 * out, {16, 0.18, 0.2}, slant, Material::kConcrete);
  for (int i = 0; i < 5; ++i) {  // planters and bollards before it
    const double x = -3.4 + 1.7 * i + b.Uniform(-0.2, 0.2);
    const double z = b.Uniform(3.2, 5.0);
    if (std::abs(x) < 0.7) continue;
    if (i % 2 == 0) {
      b.Box({x, 1.6, z}, {0.8, 0.5, 0.5}, b.Uniform(-0.2, 0.2), Material::kConcrete);
      b.Box({x, 1.1, z}, {0.7, b.Uniform(0.3, 0.6), 0.4}, b.Uniform(-0.2, 0.2), Material::kFoliage);
    } else {
      b.Box({x, 1.6, z}, {0.6, b.Uniform(1.1, 1.5), 0.3}, b.Uniform(-0.5, 0.5), Material::kPoster);
    }
  }
  b.Cylinder({-1.35, 1.6, 2.7}, 0.07, 1.1, Material::kMetal);
  b.Cylinder({1.55, 1.6, 2.9}, 0.07, 1.1, Material::kMetal);
  b.Box({0.1, 1.6, 5.3}, {1.3, 0.42, 0.45}, slant, Material::kPlanks);
}

void Shelves(Builder& b) {
  b.SetViewpoint({0, 0, 0}, {0, 0.1, 4.4}, 0.021);
  b.SetLamp({0.4, -1.7, 2.4}, 0.3);
  b.Hall(-4.6, 4.6, -1.9, 1.4, 8.0, Material::kConcrete, Material::kAsphalt, Material::kBricks);
  b.Shelf({-2.9, -1.2, 6.2}, {2.7, 2.6, 0.6}, 4);
  b.Shelf({0.3, -1.2, 6.5}, {2.9, 2.6, 0.6}, 4);
  b.Shelf({-3.9, -1.0, 4.3}, {1.7, 2.4, 0.5}, 4);
  b.Shelf({2.0, -1.0, 4.6}, {1.8, 2.4, 0.5}, 4);
  b.Box({-0.6, 1.4, 4.4}, {0.8, 0.5, 0.6}, b.Uniform(-0.3, 0.5), Material::kCardboard);
  b.Box({-0.65, 0.9, 4.4}, {0.55, 0.4, 0.5}, b.Uniform(-0.4, 0.4), Material::kCardboard);
  b.Box({0.75, 1.4, 5.2}, {0.6, 0.8, 0.5}, b.Uniform(-0.3, 0.3), Material::kMetal);
  b.Box({-1.35, 1.4, 2.7}, {0.6, 0.6, 0.5}, b.Uniform(-0.5, 0.5), Material::kCardboard);
  b.Box({1.4, 1.4, 2.9}, {0.5, 0.9, 0.4}, b.Uniform(-0.5, 0.5), Material::kPoster);
}

// Wanders about `pivot` by some decimetres and some twenty degrees, in seconds.
BodyMotion Wander(Builder& b, const Vector3d& pivot, const Vector3d& reach_m, double turn_rad) {
  Vector3d phase;
  Vector3d period;
  for (int axis = 0; axis < 3; ++axis) {
    phase[axis] = b.Uniform(0.0, kTurn);
    period[axis] = b.Uniform(90.0, 170.0);
  }
  const double turn_phase = b.Uniform(0.0, kTurn);
  const double turn_period = b.Uniform(110.0, 180.0);
  const Vector3d axis = Vector3d(b.Uniform(-0.4, 0.4), 1.0, b.Uniform(-0.4, 0.4)).normalized();
  return [=](double frame) {
    Vector3d shift;
    for (int k = 0; k < 3; ++k) {
      shift[k] = reach_m[k] * std::sin(kTurn * frame / period[k] + phase[k]);
    }
    const double angle = turn_rad * std::sin(kTurn * frame / turn_period + turn_phase);
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(angle, axis));
    return Rigid3{rotation, pivot + shift - rotation * pivot};
  };
}

void Bodies(Builder& b) {
  RoomShell(b, 0.014);
  RoomWalls(b);
  b.Shelf({-3.3, -0.9, 7.15}, {1.9, 2.3, 0.4}, 5);
  b.Box({2.4, 1.4, 5.8}, {0.9, 1.0, 0.6}, 0.3, Material::kCardboard);
  struct Body {
    Vector3d middle, size;
    Material material;
  };
  for (const Body& body : {Body{{-1.25, 0.6, 3.7}, {1.0, 0.9, 0.8}, Material::kPoster},
                           Body{{0.55, -0.1, 4.4}, {0.9, 1.1, 0.9}, Material::kCardboard},
                           Body{{1.75, 0.55, 3.6}, {0.8, 0.9, 0.7}, Material::kFabric}}) {
    b.SetMotion(Wander(b, body.middle, {0.3, 0.12, 0.3}, 0.35));
    b.Box(body.middle + Vector3d(0, 0.5 * body.size.y(), 0),
          body.size,
          b.Uniform(-0.6, 0.6),
          body.material);
  }
  b.SetMotion({});
}

void AddCloth(Builder& b) {
  const double phase = b.Uniform(0.0, kTurn);
  const double tilt = b.Uniform(-0.25, 0.25);
  b.Add(
      [=](double s, double t, double frame) -> Vector3d {
        const double loose = 0.15 + 0.85 * t;  // held by its upper edge
        const double wave =
            0.11 * std::sin(kTurn * (1.2 * s - frame / 70.0) + phase) +
            0.06 * std::sin(kTurn * (2.1 * s + 0.8 * t + frame / 48.0)) +
            0.03 * std::sin(kTurn * (3.7 * s - 0.6 * t + frame / 37.0) + 2.0 * phase);
        const double pleat = 0.025 * std::sin(kTurn * 6.0 * s);
        const double sway = 0.10 * t * t * std::sin(kTurn * frame / 95.0 + phase);
        return Vector3d(-1.75 + 3.5 * s + sway,
                        -1.25 + 2.35 * t - 0.08 * std::sin(std::numbers::pi * s) * (1.0 - t),
                        3.6 + tilt * (s - 0.5) + loose * wave + pleat);
      },
      48,
      32,
      3.5,
      2.35,
      Material::kFabric,
      1.2);
  b.design_.patches.back().moves = true;
}

void Cloth(Builder& b) {
  RoomShell(b, 0.014);
  RoomWalls(b);
  b.Cylinder({-1.8, 1.4, 3.6}, 0.03, 2.66, Material::kMetal);
  b.Cylinder({1.8, 1.4, 3.6}, 0.03, 2.66, Material::kMetal);
  b.Box({-2.4, 1.4, 5.0}, {0.6, 1.0, 0.6}, 0.3, Material::kPoster);
  b.Box({2.5, 1.4, 4.6}, {0.6, 0.8, 0.6}, -0.3, Material::kCardboard);
  AddCloth(b);
}

}  // namespace

SceneDesign DesignScene(SceneName scene, unsigned seed, double focal_px) {
  Builder builder(seed, focal_px);
  switch (scene) {
    case SceneName::kRoom:
      Room(builder);
      break;
    case SceneName::kCorridor:
      Corridor(builder);
      break;
    case SceneName::kStreet:
      Street(builder);
      break;
    case SceneName::kTabletop:
      Tabletop(builder);
      break;
    case SceneName::kFacade:
      Facade(builder);
      break;
    case SceneName::kShelves:
      Shelves(builder);
      break;
    case SceneName::kBodies:
      Bodies(builder);
      break;
    case SceneName::kCloth:
      Cloth(builder);
      break;
  }
  return builder.Finish();
}

}  // namespace cohort
