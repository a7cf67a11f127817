#include "datasets/synthetic_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <opencv2/core/persistence.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>

#include "datasets/tum_writer.h"
#include "frontend/core/output.h"
#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr double kFps = 30.0;
constexpr double kNearest = 0.05;  // [m]
constexpr int kSamples = 3;        // a side, of every pixel

// A slow, smooth random curve in time with unit variance: seven sines between `low` and `high`
// hertz.
double Wander(RandomStream random, int frame, double low, double high) {
  double sum = 0.0;
  for (int i = 0; i < 7; ++i) {
    const double frequency = low * std::pow(high / low, random.Uniform());
    const double phase = random.Uniform(0.0, 2.0 * std::numbers::pi);
    sum += std::sin(2.0 * std::numbers::pi * frequency * frame / kFps + phase);
  }
  return sum * std::sqrt(2.0 / 7.0);
}

Eigen::Vector3d Wander3(const RandomStream& random, int frame, double low, double high) {
  return {Wander(random.Fork(0), frame, low, high),
          Wander(random.Fork(1), frame, low, high),
          Wander(random.Fork(2), frame, low, high)};
}

Eigen::Quaterniond RotationOf(const Eigen::Vector3d& angle_axis) {
  const double angle = angle_axis.norm();
  if (angle < 1e-12) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, angle_axis / angle));
}

}  // namespace

class SyntheticScene::Builder {
 public:
  explicit Builder(SyntheticScene& scene)
      : scene_(scene), random_(scene.options_.seed, "scene/layout") {}

  std::size_t AddTexture(TextureKind kind) {
    scene_.textures_.emplace_back(kind,
                                  scene_.options_.seed * 100ULL + scene_.textures_.size() + 1);
    return scene_.textures_.size() - 1;
  }

  // A parallelogram; its texture is laid on in metres, with an offset of its own.
  void Quad(const Eigen::Vector3d& origin,
            const Eigen::Vector3d& u,
            const Eigen::Vector3d& v,
            std::size_t texture,
            double shade = 1.0,
            int body = 0) {
    Patch patch;
    patch.origin = origin;
    patch.u = u;
    patch.v = v;
    patch.texture_origin = {random_.Uniform(0.0, kTextureMetres),
                            random_.Uniform(0.0, kTextureMetres)};
    patch.texture_u = {u.norm(), 0.0};
    patch.texture_v = {u.dot(v) / u.norm(), u.cross(v).norm() / u.norm()};
    patch.texture = texture;
    patch.shade = shade;
    patch.body = body;
    scene_.patches_.push_back(patch);
  }

  // A box on its base centre, turned about the vertical by `angle`.
  void Box(const Eigen::Vector3d& base,
           const Eigen::Vector3d& size,
           double angle,
           std::size_t texture,
           int body = 0) {
    const Eigen::Vector3d x = size.x() * Eigen::Vector3d(std::cos(angle), 0, std::sin(angle));
    const Eigen::Vector3d z = size.z() * Eigen::Vector3d(-std::sin(angle), 0, std::cos(angle));
    const Eigen::Vector3d up(0, -size.y(), 0);
    const Eigen::Vector3d corner = base - 0.5 * x - 0.5 * z;
    Quad(corner, x, up, texture, 1.0, body);
    Quad(corner + z, x, up, texture, 0.85, body);
    Quad(corner, z, up, texture, 0.75, body);
    Quad(corner + x, z, up, texture, 0.8, body);
    Quad(corner + up, x, z, texture, 1.05, body);
  }

  double Uniform(double min, double max) { return random_.Uniform(min, max); }

  void Room();
  void Corridor();
  void Street();
  void Tabletop();
  void Facade();
  void Shelves();
  void Bodies();
  void Cloth();

 private:
  void Shell(double left,
             double right,
             double top,
             double bottom,
             double far,
             std::size_t sides,
             std::size_t floor,
             std::size_t end) {
    const double near = -3.0;
    const double depth = far - near;
    Quad({left, top, far}, {right - left, 0, 0}, {0, bottom - top, 0}, end);
    Quad({left, top, near}, {0, 0, depth}, {0, bottom - top, 0}, sides, 0.85);
    Quad({right, top, near}, {0, 0, depth}, {0, bottom - top, 0}, sides, 0.8);
    Quad({left, bottom, near}, {right - left, 0, 0}, {0, 0, depth}, floor, 0.9);
    Quad({left, top, near}, {right - left, 0, 0}, {0, 0, depth}, sides, 1.05);
  }

  SyntheticScene& scene_;
  RandomStream random_;
};

void SyntheticScene::Builder::Room() {
  const auto plaster = AddTexture(TextureKind::kConcrete);
  const auto floor = AddTexture(TextureKind::kPlanks);
  const auto posters = AddTexture(TextureKind::kPosters);
  const auto gravel = AddTexture(TextureKind::kGravel);
  Shell(-4.5, 5.5, -1.7, 1.4, 8.0, plaster, floor, posters);
  for (int i = 0; i < 7; ++i) {
    Box({Uniform(-3.0, 4.5), 1.4, Uniform(3.0, 6.5)},
        {Uniform(0.4, 1.1), Uniform(0.5, 2.0), Uniform(0.4, 1.0)},
        Uniform(-0.7, 0.7),
        i % 2 == 0 ? posters : gravel);
  }
  Quad({-1.6, -1.2, 3.4}, {0.9, 0, 0.2}, {0, 0.7, 0}, posters, 1.0);  // a board that hangs free
}

void SyntheticScene::Builder::Corridor() {
  const auto bricks = AddTexture(TextureKind::kBricks);
  const auto tiles = AddTexture(TextureKind::kTiles);
  const auto posters = AddTexture(TextureKind::kPosters);
  Shell(-1.7, 2.1, -1.5, 1.3, 13.0, bricks, tiles, posters);
  for (int i = 0; i < 6; ++i) {
    const double side = i % 2 == 0 ? -1.2 : 1.6;
    Box({side + Uniform(-0.15, 0.15), 1.3, 3.4 + 1.5 * i + Uniform(-0.3, 0.3)},
        {Uniform(0.4, 0.8), Uniform(0.6, 2.1), Uniform(0.3, 0.7)},
        Uniform(-0.3, 0.3),
        posters);
  }
}

void SyntheticScene::Builder::Street() {
  const auto ground = AddTexture(TextureKind::kGravel);
  const auto bricks = AddTexture(TextureKind::kBricks);
  const auto concrete = AddTexture(TextureKind::kConcrete);
  const auto posters = AddTexture(TextureKind::kPosters);
  Quad({-20, 1.6, -5}, {40, 0, 0}, {0, 0, 25}, ground, 0.85);
  Quad({-20, -8, 16}, {40, 0, 0}, {0, 10, 0}, concrete, 1.0);
  for (int i = 0; i < 4; ++i) {  // houses, stepping back
    const double z = 3.5 + 3.2 * i;
    const double setback = Uniform(0.0, 0.8);
    Quad({-4.2 - setback, -6, z}, {0, 0, 3.2}, {0, 7.6, 0}, i % 2 ? concrete : bricks, 0.85);
    Quad({-4.2 - setback, -6, z}, {-4, 0, 0}, {0, 7.6, 0}, i % 2 ? concrete : bricks, 0.7);
    Quad({5.2 + setback, -6, z}, {0, 0, 3.2}, {0, 7.6, 0}, i % 2 ? bricks : posters, 0.95);
    Quad({5.2 + setback, -6, z}, {4, 0, 0}, {0, 7.6, 0}, i % 2 ? bricks : posters, 0.75);
  }
  for (int i = 0; i < 6; ++i) {  // parked vans and bins
    Box({i % 2 == 0 ? Uniform(-3.4, -2.0) : Uniform(2.6, 4.6), 1.6, 3.6 + 1.7 * i},
        {Uniform(0.5, 1.3), Uniform(0.8, 1.9), Uniform(0.6, 1.4)},
        Uniform(-0.2, 0.2),
        posters);
  }
}

void SyntheticScene::Builder::Tabletop() {
  const auto wood = AddTexture(TextureKind::kPlanks);
  const auto posters = AddTexture(TextureKind::kPosters);
  const auto wall = AddTexture(TextureKind::kBricks);
  const auto fabric = AddTexture(TextureKind::kFabric);
  Quad({-4, -3, 6.0}, {10, 0, 0}, {0, 6, 0}, wall);
  Quad({-2.5, 0.75, 1.4}, {6.5, 0, 0}, {0, 0, 3.4}, wood, 0.95);
  for (int i = 0; i < 14; ++i) {
    const double z = 2.1 + 0.16 * i;
    Box({Uniform(-0.45, 0.55) * z, 0.75, z},
        {Uniform(0.12, 0.4), Uniform(0.15, 0.75), Uniform(0.12, 0.35)},
        Uniform(-0.8, 0.8),
        i % 3 == 0 ? fabric : posters);
  }
}

void SyntheticScene::Builder::Facade() {
  const auto bricks = AddTexture(TextureKind::kBricks);
  const auto plaster = AddTexture(TextureKind::kPlaster);
  const auto tiles = AddTexture(TextureKind::kTiles);
  const auto posters = AddTexture(TextureKind::kPosters);
  Quad({-9, -7, 7.0}, {20, 0, 0.8}, {0, 9, 0}, bricks);
  Quad({-9, 1.6, 0}, {20, 0, 0}, {0, 0, 8}, tiles, 0.9);
  for (int column = 0; column < 6; ++column) {
    for (int row = 0; row < 2; ++row) {  // bays and balconies before the wall
      Box({-5.0 + 2.1 * column + Uniform(-0.2, 0.2), 1.0 - 2.3 * row, 6.4 + 0.08 * column},
          {Uniform(0.8, 1.3), Uniform(0.8, 1.3), Uniform(0.5, 1.4)},
          0.04,
          (column + row) % 2 == 0 ? posters : plaster);
    }
  }
  for (int i = 0; i < 4; ++i) {  // bollards in front
    Box({-2.6 + 1.9 * i, 1.6, Uniform(3.0, 4.4)},
        {0.35, Uniform(0.8, 1.8), 0.35},
        Uniform(0.0, 0.8),
        posters);
  }
}

void SyntheticScene::Builder::Shelves() {
  const auto wood = AddTexture(TextureKind::kPlanks);
  const auto posters = AddTexture(TextureKind::kPosters);
  const auto fabric = AddTexture(TextureKind::kFabric);
  const auto concrete = AddTexture(TextureKind::kConcrete);
  Quad({-5, -3, 4.9}, {12, 0, 0}, {0, 6, 0}, concrete);
  Quad({-5, 1.6, -1}, {12, 0, 0}, {0, 0, 6}, wood, 0.85);
  for (int row = 0; row < 4; ++row) {
    const double y = 1.3 - 0.85 * row;
    Quad({-4.0, y, 3.7}, {9.5, 0, 0}, {0, 0, 0.9}, wood, 0.9);
    Quad({-4.0, y, 3.7}, {9.5, 0, 0}, {0, 0.05, 0}, wood, 0.8);
    for (int i = 0; i < 13; ++i) {
      Box({-3.7 + 0.72 * i + Uniform(-0.1, 0.1), y, Uniform(3.85, 4.4)},
          {Uniform(0.2, 0.55), Uniform(0.25, 0.72), Uniform(0.15, 0.35)},
          Uniform(-0.4, 0.4),
          (i + row) % 3 == 0 ? fabric : posters);
    }
  }
  Box({1.1, 1.6, 2.4}, {0.4, 1.0, 0.4}, 0.5, posters);
}

void SyntheticScene::Builder::Bodies() {
  Room();
  const auto fabric = AddTexture(TextureKind::kFabric);
  scene_.bodies_ = 3;
  Box({-1.2, 0.9, 2.9}, {0.9, 0.9, 0.7}, 0.3, fabric, 1);
  Box({0.6, 0.2, 3.6}, {0.8, 1.0, 0.8}, -0.4, 2, 2);
  Box({2.2, 0.8, 3.2}, {0.9, 1.1, 0.6}, 0.1, fabric, 3);
}

void SyntheticScene::Builder::Cloth() {
  const auto wall = AddTexture(TextureKind::kConcrete);
  const auto floor = AddTexture(TextureKind::kTiles);
  const auto pattern = AddTexture(TextureKind::kPosters);
  Shell(-4.5, 5.5, -1.9, 1.5, 7.5, wall, floor, wall);
  scene_.cloth_columns_ = 20;
  scene_.cloth_rows_ = 14;
  scene_.cloth_origin_ = {-1.7, -1.3, 4.0};
  scene_.cloth_u_ = {4.2, 0.0, 0.3};
  scene_.cloth_v_ = {0.0, 2.5, 0.0};
  scene_.cloth_first_ = scene_.patches_.size();
  const Eigen::Vector2d cell(scene_.cloth_u_.norm() / scene_.cloth_columns_,
                             scene_.cloth_v_.norm() / scene_.cloth_rows_);
  for (int row = 0; row < scene_.cloth_rows_; ++row) {
    for (int column = 0; column < scene_.cloth_columns_; ++column) {
      Patch lower;  // corners (0, 0), (1, 0), (0, 1) of the cell; where they are follows the frame
      lower.triangle = true;
      lower.texture = pattern;
      lower.texture_origin = {column * cell.x(), row * cell.y()};
      lower.texture_u = {cell.x(), 0.0};
      lower.texture_v = {0.0, cell.y()};
      scene_.patches_.push_back(lower);
      Patch upper = lower;  // corners (1, 1), (0, 1), (1, 0)
      upper.texture_origin += cell;
      upper.texture_u = -lower.texture_u;
      upper.texture_v = -lower.texture_v;
      scene_.patches_.push_back(upper);
    }
  }
}

SyntheticScene::SyntheticScene(const SyntheticSceneOptions& options) : options_(options) {
  ValidateOptions(options);
  camera_.width_px = options.width_px;
  camera_.height_px = options.height_px;
  camera_.fx = camera_.fy = options.focal_px;
  camera_.cx = (options.width_px - 1) / 2.0;
  camera_.cy = (options.height_px - 1) / 2.0;
  Builder builder(*this);
  switch (options.scene) {
    case SceneName::kRoom:
      builder.Room();
      break;
    case SceneName::kCorridor:
      builder.Corridor();
      break;
    case SceneName::kStreet:
      builder.Street();
      break;
    case SceneName::kTabletop:
      builder.Tabletop();
      break;
    case SceneName::kFacade:
      builder.Facade();
      break;
    case SceneName::kShelves:
      builder.Shelves();
      break;
    case SceneName::kBodies:
      builder.Bodies();
      break;
    case SceneName::kCloth:
      builder.Cloth();
      break;
  }
}

Rigid3 SyntheticScene::CamFromWorld(int frame) const {
  const RandomStream random(options_.seed, "scene/camera");
  // Hand shake: a slow sway and a fast tremor.
  const Eigen::Vector3d sway = Wander3(random.Fork(1), frame, 0.2, 1.2);
  const Eigen::Vector3d tremor = Wander3(random.Fork(2), frame, 2.0, 7.0);
  const Eigen::Vector3d turn = Wander3(random.Fork(3), frame, 0.2, 1.0);
  const Eigen::Vector3d jitter = Wander3(random.Fork(4), frame, 2.0, 7.0);
  Eigen::Vector3d centre = 0.03 * sway + 0.0025 * tremor;
  Eigen::Vector3d angles = Eigen::Vector3d(0.012, 0.015, 0.01).cwiseProduct(turn) +
                           Eigen::Vector3d(0.0022, 0.0022, 0.0018).cwiseProduct(jitter);
  const double t = frame;
  switch (options_.motion) {
    case Motion::kLateral:
      centre += Eigen::Vector3d(-0.6 + 0.017 * t, 0.0, 0.001 * t);
      break;
    case Motion::kForward:
      centre += Eigen::Vector3d(0.1, 0.0, -1.2 + 0.02 * t);
      break;
    case Motion::kOrbit: {
      const double angle = -0.30 + 0.0045 * t;
      const Eigen::Vector3d pivot(0.3, 0.0, 4.5);
      centre += pivot + 4.3 * Eigen::Vector3d(std::sin(angle), 0.0, -std::cos(angle));
      angles.y() -= angle;
      break;
    }
  }
  const Rigid3 world_from_cam{RotationOf(angles), centre};
  return world_from_cam.Inverse();
}

Rigid3 SyntheticScene::BodyMotion(int body, int frame) const {
  // About its own middle, wandering at the speed of a toy that somebody pushes.
  const RandomStream random =
      RandomStream(options_.seed, "scene/bodies").Fork(static_cast<std::uint64_t>(body));
  const Eigen::Vector3d shift =
      Wander3(random.Fork(0), frame, 0.08, 0.35) - Wander3(random.Fork(0), 0, 0.08, 0.35);
  const Eigen::Vector3d turn =
      Wander3(random.Fork(1), frame, 0.08, 0.3) - Wander3(random.Fork(1), 0, 0.08, 0.3);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  int corners = 0;
  for (const Patch& patch : patches_) {
    if (patch.body != body) continue;
    middle += patch.origin + 0.5 * patch.u + 0.5 * patch.v;
    ++corners;
  }
  middle /= std::max(corners, 1);
  const Eigen::Quaterniond rotation =
      RotationOf(Eigen::Vector3d(0.1, 0.25, 0.1).cwiseProduct(turn));
  const Eigen::Vector3d moved = Eigen::Vector3d(0.3, 0.15, 0.2).cwiseProduct(shift);
  return {rotation, middle + moved - rotation * middle};
}

double SyntheticScene::ClothShift(double s, double t, int frame) const {
  const double time = frame / kFps;
  const double loose = 0.3 + 0.7 * t;  // it hangs from its upper edge
  return loose * (0.10 * std::sin(7.0 * s + 2.2 * time) + 0.06 * std::sin(11.0 * t - 3.1 * time) +
                  0.05 * std::sin(9.0 * (s + t) + 1.3 * time));
}

std::vector<SyntheticScene::Patch> SyntheticScene::PatchesAt(int frame) const {
  std::vector<Patch> patches = patches_;
  std::vector<Rigid3> motions;
  for (int body = 1; body <= bodies_; ++body) motions.push_back(BodyMotion(body, frame));
  for (Patch& patch : patches) {
    if (patch.body == 0) continue;
    const Rigid3& motion = motions[static_cast<std::size_t>(patch.body - 1)];
    patch.origin = motion * patch.origin;
    patch.u = motion.rotation * patch.u;
    patch.v = motion.rotation * patch.v;
  }
  if (cloth_columns_ > 0) {
    const Eigen::Vector3d out = cloth_u_.cross(cloth_v_).normalized();
    const auto corner = [&](int column, int row) -> Eigen::Vector3d {
      const double s = static_cast<double>(column) / cloth_columns_;
      const double t = static_cast<double>(row) / cloth_rows_;
      return cloth_origin_ + s * cloth_u_ + t * cloth_v_ + ClothShift(s, t, frame) * out;
    };
    std::size_t next = cloth_first_;
    for (int row = 0; row < cloth_rows_; ++row) {
      for (int column = 0; column < cloth_columns_; ++column) {
        const Eigen::Vector3d p00 = corner(column, row);
        const Eigen::Vector3d p10 = corner(column + 1, row);
        const Eigen::Vector3d p01 = corner(column, row + 1);
        const Eigen::Vector3d p11 = corner(column + 1, row + 1);
        Patch& lower = patches[next++];
        lower.origin = p00;
        lower.u = p10 - p00;
        lower.v = p01 - p00;
        Patch& upper = patches[next++];
        upper.origin = p11;
        upper.u = p01 - p11;
        upper.v = p10 - p11;
        // A little light and shade.
        lower.shade = upper.shade =
            1.0 - 0.25 * std::abs(lower.u.cross(lower.v).normalized().dot(out) - 1.0);
      }
    }
  }
  return patches;
}

namespace {

// Of a plane seen by a camera, as functions of the homogeneous pixel q = (x, y, 1):
//   depth = c / (n.q),  s = (s_.q) / (n.q),  t = (t_.q) / (n.q)
struct PlaneProjection {
  Eigen::Vector3d n, s, t;
  double c = 0.0;
};

PlaneProjection ProjectPlane(const Eigen::Vector3d& origin,
                             const Eigen::Vector3d& u,
                             const Eigen::Vector3d& v,
                             const Rigid3& cam_from_world,
                             const Camera& camera) {
  const Eigen::Vector3d o = cam_from_world * origin;
  const Eigen::Vector3d eu = cam_from_world.rotation * u;
  const Eigen::Vector3d ev = cam_from_world.rotation * v;
  Eigen::Matrix3d K_inverse;
  K_inverse << 1.0 / camera.fx, 0.0, -camera.cx / camera.fx, 0.0, 1.0 / camera.fy,
      -camera.cy / camera.fy, 0.0, 0.0, 1.0;
  const Eigen::Vector3d normal = eu.cross(ev);
  const double square = normal.squaredNorm();
  // p = o + s eu + t ev: s = (p - o).a, t = (p - o).b with the dual basis.
  const Eigen::Vector3d a = ev.cross(normal) / square;
  const Eigen::Vector3d b = normal.cross(eu) / square;
  PlaneProjection plane;
  plane.c = normal.dot(o);
  plane.n = K_inverse.transpose() * normal;
  plane.s = K_inverse.transpose() * (plane.c * a - a.dot(o) * normal);
  plane.t = K_inverse.transpose() * (plane.c * b - b.dot(o) * normal);
  return plane;
}

}  // namespace

std::optional<SyntheticScene::Moment::Hit> SyntheticScene::Moment::Cast(
    const Eigen::Vector2d& xy) const {
  std::optional<Hit> nearest;
  const Eigen::Vector3d q = xy.homogeneous();
  for (std::size_t i = 0; i < patches_.size(); ++i) {
    const Patch& patch = patches_[i];
    const PlaneProjection plane =
        ProjectPlane(patch.origin, patch.u, patch.v, cam_from_world_, camera_);
    const double w = plane.n.dot(q);
    if (w == 0.0) continue;
    const double depth = plane.c / w;
    if (!(depth > kNearest) || (nearest && depth >= nearest->depth)) continue;
    const double s = plane.s.dot(q) / w;
    const double t = plane.t.dot(q) / w;
    if (s < 0.0 || t < 0.0 || (patch.triangle ? s + t > 1.0 : s > 1.0 || t > 1.0)) continue;
    nearest = Hit{depth, {i, s, t}};
  }
  return nearest;
}

namespace {

constexpr double kFarthest = 1000.0;  // [m]

// a + b k for sample k of a row: sample k lies at x = (k - 1) / 3, so that three make a pixel.
struct Linear {
  double a = 0.0;
  double b = 0.0;
  double At(int k) const { return a + b * k; }
  Linear Minus(const Linear& other) const { return {a - other.a, b - other.b}; }
};

// A function that is linear in the homogeneous pixel (x, y, 1).
struct PixelPlane {
  Eigen::Vector3d q;
  Linear AtRow(double y) const {
    const double step = q.x() / kSamples;
    return {q.y() * y + q.z() - (kSamples / 2) * step, step};
  }
};

// Samples first..last; empty if last < first.
struct Run {
  int first;
  int last;
  void KeepNonNegative(const Linear& f) {
    if (f.b == 0.0) {
      if (f.a < 0.0) last = first - 1;
      return;
    }
    const double zero = -f.a / f.b;
    if (f.b > 0.0) {
      if (zero > first) first = zero > last ? last + 1 : static_cast<int>(std::ceil(zero));
    } else if (zero < last) {
      last = zero < first ? first - 1 : static_cast<int>(std::floor(zero));
    }
  }
};

}  // namespace

SyntheticScene::Rendering SyntheticScene::Render(int frame) const {
  const Rigid3 cam_from_world = CamFromWorld(frame);
  const std::vector<Patch> patches = PatchesAt(frame);
  std::vector<PixelPlane> inverse_depth;
  std::vector<PixelPlane> s_over_depth;
  std::vector<PixelPlane> t_over_depth;
  for (const Patch& patch : patches) {
    const PlaneProjection plane =
        ProjectPlane(patch.origin, patch.u, patch.v, cam_from_world, camera_);
    inverse_depth.push_back({plane.n / plane.c});
    s_over_depth.push_back({plane.s / plane.c});
    t_over_depth.push_back({plane.t / plane.c});
  }
  // What a sample covers at 1 m [m]; a little more, so that neighbours overlap.
  const double footprint = 1.5 / camera_.fx / kSamples;

  Rendering rendering;
  rendering.image.create(camera_.height_px, camera_.width_px, CV_32FC1);
  rendering.depth.create(camera_.height_px, camera_.width_px, CV_32FC1);
  // Rows are independent: the bytes do not depend on the threads.
  cv::parallel_for_(cv::Range(0, camera_.height_px), [&](const cv::Range& range) {
    const int width = camera_.width_px * kSamples;
    std::vector<double> z(static_cast<std::size_t>(width));
    std::vector<int> owner(static_cast<std::size_t>(width));
    std::vector<float> sums(static_cast<std::size_t>(camera_.width_px));
    for (int y = range.start; y < range.end; ++y) {
      std::fill(sums.begin(), sums.end(), 0.0F);
      for (int row = 0; row < kSamples; ++row) {
        const double sample_y = y + (row - (kSamples - 1) / 2.0) / kSamples;
        std::fill(z.begin(), z.end(), 0.0);  // inverse depth
        std::fill(owner.begin(), owner.end(), -1);
        for (std::size_t i = 0; i < patches.size(); ++i) {
          // In a row all that decides is linear in x: 1/depth, and s, t over depth. So a patch
          // covers one run of samples.
          const Linear inverse = inverse_depth[i].AtRow(sample_y);
          const Linear s = s_over_depth[i].AtRow(sample_y);
          const Linear t = t_over_depth[i].AtRow(sample_y);
          Run run{0, width - 1};
          run.KeepNonNegative(inverse.Minus({1.0 / kFarthest, 0.0}));
          run.KeepNonNegative(s);
          run.KeepNonNegative(t);
          if (patches[i].triangle) {
            run.KeepNonNegative(inverse.Minus(s).Minus(t));
          } else {
            run.KeepNonNegative(inverse.Minus(s));
            run.KeepNonNegative(inverse.Minus(t));
          }
          for (int k = run.first; k <= run.last; ++k) {
            const double value = inverse.At(k);
            if (value <= z[static_cast<std::size_t>(k)] || value > 1.0 / kNearest) continue;
            z[static_cast<std::size_t>(k)] = value;
            owner[static_cast<std::size_t>(k)] = static_cast<int>(i);
          }
        }
        for (int k = 0; k < width; ++k) {
          const int i = owner[static_cast<std::size_t>(k)];
          float value = 0.0F;
          if (i >= 0) {
            const auto index = static_cast<std::size_t>(i);
            const Patch& patch = patches[index];
            const double depth = 1.0 / z[static_cast<std::size_t>(k)];
            const double s = depth * s_over_depth[index].AtRow(sample_y).At(k);
            const double t = depth * t_over_depth[index].AtRow(sample_y).At(k);
            const Eigen::Vector2d m =
                patch.texture_origin + s * patch.texture_u + t * patch.texture_v;
            value = static_cast<float>(patch.shade) *
                    textures_[patch.texture].At(m.x(), m.y(), footprint * depth);
          }
          sums[static_cast<std::size_t>(k / kSamples)] += value;
        }
        if (row == kSamples / 2) {
          for (int x = 0; x < camera_.width_px; ++x) {
            const double inverse = z[static_cast<std::size_t>(x * kSamples + kSamples / 2)];
            rendering.depth.at<float>(y, x) =
                inverse > 0.0 ? static_cast<float>(1.0 / inverse) : 0.0F;
          }
        }
      }
      float* out = rendering.image.ptr<float>(y);
      for (int x = 0; x < camera_.width_px; ++x) {
        out[x] = std::min(sums[static_cast<std::size_t>(x)] / (kSamples * kSamples), 1.0F);
      }
    }
  });
  return rendering;
}

SyntheticScene::Moment SyntheticScene::At(int frame) const {
  Moment moment;
  moment.camera_ = camera_;
  moment.cam_from_world_ = CamFromWorld(frame);
  moment.patches_ = PatchesAt(frame);
  return moment;
}

std::optional<SurfacePoint> SyntheticScene::Moment::Pick(const Eigen::Vector2d& xy) const {
  const auto hit = Cast(xy);
  if (!hit) return std::nullopt;
  return hit->point;
}

Eigen::Vector3d SyntheticScene::Moment::WorldPoint(const SurfacePoint& point) const {
  const Patch& patch = patches_.at(point.patch);
  return patch.origin + point.s * patch.u + point.t * patch.v;
}

std::optional<Eigen::Vector2d> SyntheticScene::Moment::Project(const SurfacePoint& point) const {
  return camera_.Project(cam_from_world_ * WorldPoint(point));
}

double SyntheticScene::Moment::Depth(const SurfacePoint& point) const {
  return (cam_from_world_ * WorldPoint(point)).z();
}

bool SyntheticScene::Moment::IsUnobstructed(const SurfacePoint& point) const {
  const auto xy = Project(point);
  if (!xy) return false;
  const auto hit = Cast(*xy);
  return !hit || hit->depth > 0.999 * Depth(point);
}

namespace {

std::string SceneJson(const SyntheticSceneOptions& o) {
  return fmt::format(
      "{{\n  \"scene\": \"{}\",\n  \"motion\": \"{}\",\n  \"frames\": {},\n  \"width_px\": {},\n"
      "  \"height_px\": {},\n  \"focal_px\": {},\n  \"seed\": {},\n  \"version\": 1\n}}\n",
      NameOf(kSceneNames, o.scene),
      NameOf(kMotionNames, o.motion),
      o.frames,
      o.width_px,
      o.height_px,
      o.focal_px,
      o.seed);
}

template <typename Enum, std::size_t N>
Enum ValueOf(const ChoiceNames<Enum, N>& names,
             const std::string& text,
             const std::filesystem::path& path) {
  for (const auto& [name, value] : names) {
    if (name == text) return value;
  }
  ThrowError("{}: unknown value '{}'", path.string(), text);
}

}  // namespace

std::optional<SyntheticSceneOptions> ReadSceneFile(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "scene.json";
  if (!std::filesystem::exists(path)) return std::nullopt;
  try {
    const cv::FileStorage file(path.string(), cv::FileStorage::READ);
    SyntheticSceneOptions o;
    o.scene = ValueOf(kSceneNames, file["scene"].string(), path);
    o.motion = ValueOf(kMotionNames, file["motion"].string(), path);
    o.frames = static_cast<int>(file["frames"]);
    o.width_px = static_cast<int>(file["width_px"]);
    o.height_px = static_cast<int>(file["height_px"]);
    o.focal_px = static_cast<double>(file["focal_px"]);
    o.seed = static_cast<unsigned>(static_cast<double>(file["seed"]));
    if (static_cast<int>(file["version"]) != 1) {
      ThrowError("{} is of another version of cohort: render the clip again", path.string());
    }
    ValidateOptions(o);
    return o;
  } catch (const cv::Exception&) {
    ThrowError("{} is no scene file of cohort", path.string());
  }
}

void RenderSequence(const SyntheticSceneOptions& options,
                    const std::filesystem::path& out,
                    const Progress& progress) {
  const SyntheticScene scene(options);
  TumWriter writer(out);
  writer.WriteCamera(scene.camera());
  for (int frame = 0; frame < options.frames; ++frame) {
    const SyntheticScene::Rendering rendering = scene.Render(frame);
    cv::Mat picture;
    rendering.image.convertTo(picture, CV_8U, 255.0);
    const auto timestamp_ns = static_cast<std::int64_t>(std::llround(frame * 1e9 / kFps));
    writer.AddFrame(picture, timestamp_ns);
    writer.AddPose(scene.CamFromWorld(frame), timestamp_ns);
    writer.AddDepth(rendering.depth, timestamp_ns);
    if (progress)
      progress(static_cast<std::size_t>(frame) + 1, static_cast<std::size_t>(options.frames));
  }
  writer.AddFile("scene.json", SceneJson(options));
  writer.Finish();
}

}  // namespace cohort
