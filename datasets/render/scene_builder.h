#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <initializer_list>

#include "datasets/render/scene_geometry.h"
#include "frontend/core/random_stream.h"
#include "frontend/geometry/rigid3.h"

namespace cohort {

// world_from_rest of a body in a frame.
using BodyMotion = std::function<Rigid3(double frame)>;

// Assembles a scene from surfaces, boxes and furniture. World: x right, y down, z ahead [m]; the
// camera starts near the origin. Things draw their sizes and shades from one stream of random
// numbers, in the order in which they are added. If a call takes several random arguments, draw
// them into variables first, because C++ does not specify the order of arguments.
class SceneBuilder {
 public:
  // Textures have about one texel per pixel of a camera of this focal length.
  SceneBuilder(unsigned seed, double focal_px)
      : random_(seed, "scene/layout"), focal_px_(focal_px) {}

  double Uniform(double min, double max) { return random_.Uniform(min, max); }
  std::uint64_t Below(std::uint64_t n) { return random_.Below(n); }
  Material OneOf(std::initializer_list<Material> materials) {
    return materials.begin()[random_.Below(materials.size())];
  }

  void SetViewpoint(const Eigen::Vector3d& centre,
                    const Eigen::Vector3d& target,
                    double metres_per_frame);
  void SetLamp(const Eigen::Vector3d& lamp, double ambient);
  // Things added while it is set have this motion.
  void SetMotion(BodyMotion motion) { motion_ = std::move(motion); }

  // Any surface; `deforms`: its shape depends on the frame.
  void Surface(
      Patch::Shape shape, int columns, int rows, const TextureSpec& texture, bool deforms = false);

  // A parallelogram seen from its front: `corner` is its upper left, `s` points right, `t` down.
  void Quad(const Eigen::Vector3d& corner,
            const Eigen::Vector3d& s,
            const Eigen::Vector3d& t,
            Material material,
            double brightness = 1.0);

  // A box standing on `base` (the middle of its underside), turned about the vertical [rad].
  void Box(const Eigen::Vector3d& base,
           const Eigen::Vector3d& size,
           double angle,
           Material sides,
           Material top,
           double brightness = 1.0);
  void Box(const Eigen::Vector3d& base,
           const Eigen::Vector3d& size,
           double angle,
           Material material) {
    Box(base, size, angle, material, material);
  }

  // Upright, with `base` the middle of its underside, closed on top.
  void Cylinder(const Eigen::Vector3d& base,
                double radius,
                double height,
                Material material,
                double brightness = 1.0);

  // Floor, ceiling, back and side walls, open behind the camera.
  void Hall(double left,
            double right,
            double top,
            double bottom,
            double back,
            Material walls,
            Material floor,
            Material end);

  // An open cupboard with its back at `upper_left.z`: boards at even distances, filled with things.
  void Shelf(const Eigen::Vector3d& upper_left, const Eigen::Vector3d& size, int levels);
  void Table(const Eigen::Vector3d& base, double width, double depth, double height, double angle);
  void Plant(const Eigen::Vector3d& base, double height);
  void Tree(const Eigen::Vector3d& base, double height);
  void Car(const Eigen::Vector3d& base, double angle);
  // On a wall: a window or door with its sill.
  void Opening(const Eigen::Vector3d& upper_left,
               const Eigen::Vector3d& right,
               double height,
               const Eigen::Vector3d& outward,
               Material material);

  // Sets the resolution of the textures: as many texels as pixels see the surface from near the
  // path, within memory limits.
  SceneDesign Finish();

 private:
  // Varies the shade of things: while an instance lives, all that is added shares one shade.
  class Shade;

  // Books, a box or a can on a board at `left_back`, at most `room` wide, where boards are `step`
  // apart [m]. Returns the width that it uses.
  double ThingOnBoard(const Eigen::Vector3d& left_back,
                      double room,
                      double step,
                      double board_depth);

  RandomStream random_;
  double focal_px_;
  BodyMotion motion_;
  double shade_ = 1.0;  // of the thing being added
  SceneDesign design_;
};

}  // namespace cohort
