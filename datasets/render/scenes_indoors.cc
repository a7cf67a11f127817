#include "datasets/render/scenes.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace cohort {
namespace {

using Eigen::Vector3d;

void RoomShell(SceneBuilder& b, double metres_per_frame) {
  b.SetViewpoint({0, -0.1, 0}, {0, 0.35, 4.6}, metres_per_frame);
  b.SetLamp({-0.6, -1.1, 3.0}, 0.3);
  b.Hall(-3.7, 3.9, -1.35, 1.4, 7.2, Material::kPlaster, Material::kPlanks, Material::kPlaster);
  // Skirting boards and a carpet.
  b.Quad({-3.7, 1.3, 7.17}, {7.6, 0, 0}, {0, 0.1, 0}, Material::kPlanks, 1.4);
  b.Quad({-3.67, 1.3, -3}, {0, 0, 10.2}, {0, 0.1, 0}, Material::kPlanks, 1.4);
  b.Quad({3.87, 1.3, 7.2}, {0, 0, -10.2}, {0, 0.1, 0}, Material::kPlanks, 1.4);
  b.Quad({b.Uniform(-1.9, -1.3), 1.39, 5.9}, {3.2, 0, 0.2}, {0.15, 0, -2.3}, Material::kCarpet);
}

void RoomWalls(SceneBuilder& b) {
  b.Opening({-3.7, -0.9, 4.1}, {0, 0, 1.7}, 1.4, {1, 0, 0}, Material::kWindow);
  b.Opening({3.9, -0.75, 4.9}, {0, 0, -0.95}, 2.1, {-1, 0, 0}, Material::kDoor);
  for (int i = 0; i < 2; ++i) {
    const double width = b.Uniform(0.6, 1.0);
    const double height = b.Uniform(0.6, 0.9);
    const double top = b.Uniform(-0.9, -0.6);
    b.Quad({3.87, top, 6.7 - 3.1 * i}, {0, 0, -width}, {0, height, 0}, Material::kPoster);
  }
  for (int i = 0; i < 4; ++i) {
    const double height = b.Uniform(0.6, 1.1);
    const double width = b.Uniform(0.6, 1.0);
    const double left = -1.15 + 1.25 * i + b.Uniform(-0.1, 0.1);
    const double top = b.Uniform(-1.1, -0.8);
    b.Quad({left, top, 7.17}, {width, 0, 0}, {0, height, 0}, Material::kPoster);
  }
}

// A table with things on it.
void TableWithThings(SceneBuilder& b) {
  const double z = b.Uniform(4.5, 4.9);
  const Vector3d table(b.Uniform(-0.4, 0.3), 1.4, z);
  b.Table(table, 1.5, 0.9, 0.74, b.Uniform(-0.3, 0.3));
  for (int i = 0; i < 5; ++i) {
    const Material material = b.OneOf({Material::kPoster, Material::kCardboard, Material::kFabric});
    const double angle = b.Uniform(-0.8, 0.8);
    const double width = b.Uniform(0.1, 0.22);
    const double height = b.Uniform(0.08, 0.35);
    const double depth = b.Uniform(0.1, 0.22);
    const Vector3d at = table + Vector3d(-0.52 + 0.26 * i, -0.74, b.Uniform(-0.25, 0.25));
    b.Box(at, {width, height, depth}, angle, material);
  }
}

// Doors, posters, pillars and boxes along one wall; `side` -1: the left one.
void CorridorSide(SceneBuilder& b, double side) {
  const double wall = side < 0 ? -1.95 : 2.05;
  const Vector3d inward(-side, 0, 0);
  const Vector3d right(0, 0, side < 0 ? 1.0 : -1.0);
  const double first = b.Uniform(1.6, 2.3);
  for (int i = 0; i < 5; ++i) {
    const double z = first + 2.1 * i;
    b.Opening({wall, -0.7, z}, 0.9 * right, 2.1, inward, Material::kDoor);
    const double w = b.Uniform(0.4, 0.7);
    const double h = b.Uniform(0.5, 0.8);
    const double top = b.Uniform(-0.7, -0.4);
    b.Quad({wall - 0.03 * side, top, z + 1.05}, w * right, {0, h, 0}, Material::kPoster);
    // Pillars in front of the wall.
    b.Box({wall - 0.1 * side, 1.4, z - 0.55 + (side > 0 ? 0.3 : 0.0)},
          {0.2, 2.65, 0.3},
          0.0,
          Material::kBricks);
  }
  for (int i = 0; i < 5; ++i) {
    const double z = 2.9 + 1.7 * i + b.Uniform(-0.3, 0.3);
    const double height = b.Uniform(0.5, 1.1);
    const Vector3d base(wall - side * b.Uniform(0.4, 0.6), 1.4, z);
    const Material material = b.OneOf({Material::kCardboard, Material::kPoster, Material::kMetal});
    const double angle = b.Uniform(-0.3, 0.3);
    const double width = b.Uniform(0.4, 0.6);
    const double depth = b.Uniform(0.4, 0.6);
    b.Box(base, {width, height, depth}, angle, material);
    if (b.Below(2) == 0) {  // a smaller one on it
      const Material top = b.OneOf({Material::kCardboard, Material::kFabric});
      const double top_angle = b.Uniform(-0.5, 0.5);
      const double top_height = b.Uniform(0.25, 0.5);
      b.Box(base - Vector3d(0, height, 0), {0.35, top_height, 0.35}, top_angle, top);
    }
  }
}

// A can, a pile of books, a plant or, mostly, a box, of about `size` m.
void ThingOnTable(SceneBuilder& b, const Vector3d& at, double size) {
  switch (b.Below(5)) {
    case 0: {
      const Material material = b.OneOf({Material::kFabric, Material::kPoster, Material::kMetal});
      b.Cylinder(at, 0.35 * size, b.Uniform(0.8, 1.8) * size, material);
      break;
    }
    case 1: {
      double height = 0.0;
      for (int book = 0; book < 4; ++book) {
        const double thick = b.Uniform(0.02, 0.05);
        const Material sides = b.OneOf({Material::kBooks, Material::kFabric});
        const double angle = b.Uniform(-0.5, 0.5);
        b.Box(at - Vector3d(0, height, 0),
              {1.5 * size, thick, 1.1 * size},
              angle,
              sides,
              Material::kPoster);
        height += thick;
      }
      break;
    }
    case 2:
      b.Plant(at, 2.2 * size);
      break;
    default: {
      const Material material =
          b.OneOf({Material::kPoster, Material::kCardboard, Material::kPoster, Material::kPlanks});
      const double angle = b.Uniform(-0.8, 0.8);
      const double width = b.Uniform(0.6, 1.3) * size;
      const double height = b.Uniform(0.7, 2.0) * size;
      const double depth = b.Uniform(0.6, 1.0) * size;
      b.Box(at, {width, height, depth}, angle, material);
      break;
    }
  }
}

// Wanders about `pivot` by some decimetres and some twenty degrees, in seconds.
BodyMotion Wander(SceneBuilder& b,
                  const Vector3d& pivot,
                  const Vector3d& reach_m,
                  double turn_rad) {
  Vector3d phase;
  Vector3d period;
  for (int axis = 0; axis < 3; ++axis) {
    phase[axis] = b.Uniform(0.0, kTurn);
    period[axis] = b.Uniform(90.0, 170.0);
  }
  const double turn_phase = b.Uniform(0.0, kTurn);
  const double turn_period = b.Uniform(110.0, 180.0);
  const double axis_z = b.Uniform(-0.4, 0.4);
  const double axis_x = b.Uniform(-0.4, 0.4);
  const Vector3d axis = Vector3d(axis_x, 1.0, axis_z).normalized();
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

void AddCloth(SceneBuilder& b) {
  const double phase = b.Uniform(0.0, kTurn);
  const double tilt = b.Uniform(-0.25, 0.25);
  b.Surface(
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
      {.material = Material::kFabric, .width_m = 3.5, .height_m = 2.35, .brightness = 1.2},
      true);
}

}  // namespace

void BuildRoom(SceneBuilder& b) {
  RoomShell(b, 0.023);
  RoomWalls(b);
  b.Shelf({-3.3, -0.9, 7.15}, {1.9, 2.3, 0.4}, 5);
  // A sofa along the back wall.
  const double sofa = b.Uniform(0.5, 1.0);
  b.Box({sofa + 1.0, 1.4, 6.55}, {2.2, 0.45, 0.9}, 0.0, Material::kFabric);
  b.Box({sofa + 1.0, 0.95, 6.9}, {2.2, 0.5, 0.2}, 0.0, Material::kFabric);
  b.Box({sofa - 0.2, 1.4, 6.55}, {0.22, 0.65, 0.9}, 0.0, Material::kFabric);
  b.Box({sofa + 2.2, 1.4, 6.55}, {0.22, 0.65, 0.9}, 0.0, Material::kFabric);
  TableWithThings(b);
  const double plant_height = b.Uniform(1.2, 1.5);
  b.Plant({-2.9, 1.4, b.Uniform(5.2, 5.6)}, plant_height);
  const double chest_height = b.Uniform(0.8, 1.1);
  b.Box({b.Uniform(2.4, 2.8), 1.4, 4.6}, {0.9, chest_height, 0.5}, 0.3, Material::kPlanks);
  b.Box({2.6, 0.55, 4.6}, {0.4, 0.5, 0.3}, b.Uniform(0.0, 0.6), Material::kPoster);
  // In front: removal boxes left, a chest and a lamp right.
  b.Box({-1.75, 1.4, 3.1}, {0.7, 0.55, 0.6}, b.Uniform(0.1, 0.5), Material::kCardboard);
  b.Box({-1.7, 0.85, 3.1}, {0.5, 0.4, 0.45}, b.Uniform(-0.4, 0.4), Material::kCardboard);
  b.Box({1.75, 1.4, 2.9}, {0.55, b.Uniform(0.85, 1.05), 0.5}, -0.3, Material::kPoster);
  b.Cylinder({1.25, 1.4, 3.6}, 0.03, 1.9, Material::kMetal);
  b.Cylinder({1.25, -0.3, 3.6}, 0.2, 0.32, Material::kFabric, 1.5);
}

void BuildCorridor(SceneBuilder& b) {
  b.SetViewpoint({0, 0, 0}, {0.1, 0.05, 5.0}, 0.018);
  b.SetLamp({0.1, -1.0, 4.5}, 0.3);
  b.Hall(-1.95, 2.05, -1.25, 1.4, 11.5, Material::kConcrete, Material::kTiles, Material::kBricks);
  for (const double side : {-1.0, 1.0}) CorridorSide(b, side);
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

void BuildTabletop(SceneBuilder& b) {
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
    for (int column = 0; column < 6; ++column) {
      if (b.Below(7) == 0) continue;
      const double z = 2.1 + 0.55 * row;
      const double shift = b.Uniform(-0.12, 0.12);
      const double x = (-0.85 + 0.34 * column + b.Uniform(-0.07, 0.07)) * 0.62 * z;
      ThingOnTable(b, {x, y, z + shift}, 0.11 + 0.05 * row);
    }
  }
}

void BuildShelves(SceneBuilder& b) {
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

void BuildBodies(SceneBuilder& b) {
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

void BuildCloth(SceneBuilder& b) {
  RoomShell(b, 0.014);
  RoomWalls(b);
  b.Cylinder({-1.8, 1.4, 3.6}, 0.03, 2.66, Material::kMetal);
  b.Cylinder({1.8, 1.4, 3.6}, 0.03, 2.66, Material::kMetal);
  b.Box({-2.4, 1.4, 5.0}, {0.6, 1.0, 0.6}, 0.3, Material::kPoster);
  b.Box({2.5, 1.4, 4.6}, {0.6, 0.8, 0.6}, -0.3, Material::kCardboard);
  AddCloth(b);
}

}  // namespace cohort
