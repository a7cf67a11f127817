#include "datasets/render/scenes.h"

#include <algorithm>
#include <cmath>

namespace cohort {
namespace {

using Eigen::Vector3d;

void House(
    SceneBuilder& b, double x, double z, double length, double side, Material wall, double top) {
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

constexpr double kLeft = -3.8;  // sides of the street [m]
constexpr double kRight = 4.2;

// Trees, cars, posts, bins and a sign.
void StreetFurniture(SceneBuilder& b) {
  b.Tree({-1.9, 1.6, b.Uniform(9.5, 10.5)}, 2.8);
  b.Tree({2.6, 1.6, b.Uniform(8.6, 9.6)}, 2.6);
  const double angle_left = b.Uniform(-0.06, 0.06);
  b.Car({-1.85, 1.72, b.Uniform(6.2, 6.8)}, angle_left);
  const double angle_right = b.Uniform(-0.06, 0.06);
  b.Car({2.15, 1.72, b.Uniform(5.2, 6.0)}, angle_right);
  for (int i = 0; i < 3; ++i) {  // posts, bins and a sign near by
    b.Cylinder({kLeft + 1.35, 1.6, 2.9 + 2.4 * i}, 0.07, 3.4, Material::kMetal);
    const Material material = b.OneOf({Material::kMetal, Material::kPoster, Material::kCardboard});
    const double angle = b.Uniform(-0.3, 0.3);
    const double width = b.Uniform(0.4, 0.6);
    const double height = b.Uniform(0.7, 1.1);
    const double depth = b.Uniform(0.4, 0.6);
    const double x = kRight - b.Uniform(1.0, 1.3);
    b.Box({x, 1.6, 3.0 + 2.2 * i}, {width, height, depth}, angle, material);
  }
  b.Quad({kLeft + 1.0, -0.7, 5.25}, {0.7, 0, 0.05}, {0, 0.55, 0}, Material::kPoster);
  b.Box({-1.55, 1.72, 3.2}, {0.5, b.Uniform(0.6, 0.8), 0.5}, 0.5, Material::kPoster);
}

// The position of the front of the house, which is not quite parallel to the camera's path.
struct FacadeWall {
  double slant;

  double Depth(double x) const { return 6.3 + slant * x; }
  Vector3d Right() const { return {1, 0, slant}; }
  Vector3d Out() const { return {slant, 0, -1}; }
};

// Windows, door and balcony above each other, and a pillar or a pipe beside them.
void FacadeColumn(SceneBuilder& b, const FacadeWall& wall, int column) {
  const Vector3d right = wall.Right();
  const Vector3d out = wall.Out();
  const double x = -5.6 + 1.75 * column + b.Uniform(-0.12, 0.12);
  const Vector3d at(x, 0, wall.Depth(x));
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
            wall.slant,
            Material::kConcrete);
    }
    if (row == 1 && column % 2 == 0) {  // a balcony
      b.Box(at + 0.48 * right + 0.5 * out + Vector3d(0, -1.35, 0),
            {1.5, 0.12, 1.0},
            wall.slant,
            Material::kConcrete);
      b.Box(at + 0.48 * right + 0.97 * out + Vector3d(0, -1.47, 0),
            {1.5, 0.75, 0.06},
            wall.slant,
            b.OneOf({Material::kMetal, Material::kFabric, Material::kPlanks}));
    }
  }
  if (column % 3 == 0) {
    b.Box(at + -0.45 * right + 0.12 * out + Vector3d(0, 1.6, 0),
          {0.35, 8.2, 0.3},
          wall.slant,
          Material::kConcrete);
  } else if (column % 3 == 1) {
    b.Cylinder(at + -0.4 * right + 0.1 * out + Vector3d(0, 1.6, 0), 0.06, 8.2, Material::kMetal);
  }
}

// Planters and boards in front of it.
void FacadeForeground(SceneBuilder& b) {
  for (int i = 0; i < 5; ++i) {
    const double x = -3.4 + 1.7 * i + b.Uniform(-0.2, 0.2);
    const double z = b.Uniform(3.2, 5.0);
    if (std::abs(x) < 0.7) continue;
    if (i % 2 == 0) {
      b.Box({x, 1.6, z}, {0.8, 0.5, 0.5}, b.Uniform(-0.2, 0.2), Material::kConcrete);
      const double angle = b.Uniform(-0.2, 0.2);
      b.Box({x, 1.1, z}, {0.7, b.Uniform(0.3, 0.6), 0.4}, angle, Material::kFoliage);
    } else {
      const double angle = b.Uniform(-0.5, 0.5);
      b.Box({x, 1.6, z}, {0.6, b.Uniform(1.1, 1.5), 0.3}, angle, Material::kPoster);
    }
  }
}

}  // namespace

void BuildStreet(SceneBuilder& b) {
  b.SetViewpoint({0, 0, 0}, {0.1, -0.1, 6.0}, 0.026);
  b.SetLamp({-9.0, -22.0, -8.0}, 0.3);
  b.Quad({-6, 1.72, 13.0}, {12, 0, 0}, {0, 0, -15}, Material::kAsphalt);
  b.Box({kLeft + 0.45, 1.72, 5.5}, {2.1, 0.12, 15.0}, 0.0, Material::kTiles);
  b.Box({kRight - 0.45, 1.72, 5.5}, {2.1, 0.12, 15.0}, 0.0, Material::kTiles);
  b.Quad({-60, -45, 45}, {120, 0, 0}, {0, 60, 0}, Material::kSky);
  double z_left = 1.5;
  double z_right = 1.0;
  for (int i = 0; i < 4; ++i) {
    const double length_left = b.Uniform(2.6, 3.6);
    const double length_right = b.Uniform(2.6, 3.6);
    const double top_left = b.Uniform(-6.0, -4.0);
    const double x_left = kLeft - b.Uniform(0.0, 0.5);
    const Material wall_left = i % 2 ? Material::kConcrete : Material::kBricks;
    House(b, x_left, z_left, length_left, -1.0, wall_left, top_left);
    const double top_right = b.Uniform(-6.0, -4.0);
    const double x_right = kRight + b.Uniform(0.0, 0.5);
    const Material wall_right = i % 2 ? Material::kBricks : Material::kPlaster;
    House(b, x_right, z_right, length_right, 1.0, wall_right, top_right);
    z_left += length_left;
    z_right += length_right;
  }
  // The end of the street: a house across it, with trees in front.
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
  StreetFurniture(b);
}

void BuildFacade(SceneBuilder& b) {
  b.SetViewpoint({0, 0, 0}, {0.2, -0.3, 6.0}, 0.025);
  b.SetLamp({9.0, -20.0, -12.0}, 0.3);
  const FacadeWall wall{b.Uniform(0.03, 0.09)};
  b.Quad({-8, -7, wall.Depth(-8)}, 16 * wall.Right(), {0, 8.6, 0}, Material::kBricks);
  b.Quad({-9, 1.6, 8}, {18, 0, 0}, {0, 0, -10}, Material::kTiles);
  for (int column = 0; column < 7; ++column) FacadeColumn(b, wall, column);
  b.Box(Vector3d(0, -1.9, wall.Depth(0)) + 0.08 * wall.Out(),
        {16, 0.18, 0.2},
        wall.slant,
        Material::kConcrete);
  FacadeForeground(b);
  b.Cylinder({-1.35, 1.6, 2.7}, 0.07, 1.1, Material::kMetal);  // bollards and a bench
  b.Cylinder({1.55, 1.6, 2.9}, 0.07, 1.1, Material::kMetal);
  b.Box({0.1, 1.6, 5.3}, {1.3, 0.42, 0.45}, wall.slant, Material::kPlanks);
}

}  // namespace cohort
