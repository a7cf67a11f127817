#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "datasets/render/scene_geometry.h"
#include "frontend/core/random_stream.h"

namespace cohort {

// The light on a scene's surfaces in their positions of frame 0: a soft lamp with shadows, and
// ambient light where nothing near blocks it. Moving things cast no shadow.
class Lighting {
 public:
  explicit Lighting(const SyntheticScene& scene);  // must outlive it

  // CV_32FC1, with about one value per decimetre of a patch.
  cv::Mat LightMap(const Patch& patch, RandomStream random) const;

 private:
  struct Blocker {  // a triangle: a corner and the two edges from it
    Eigen::Vector3d corner, u, v;
  };

  double LampSize() const { return 0.06 * (design_.lamp - design_.viewpoint.target).norm(); }
  std::vector<Blocker> BlockersIn(const Eigen::AlignedBox3d& box, double margin) const;
  double LightAt(const Patch& patch,
                 double s,
                 double t,
                 const std::vector<Blocker>& near,
                 const std::vector<Blocker>& before_lamp,
                 RandomStream& random) const;
  static bool IsBlocked(const std::vector<Blocker>& blockers,
                        const Eigen::Vector3d& origin,
                        const Eigen::Vector3d& way);

  const SceneDesign& design_;
  std::vector<Eigen::Vector3d> vertices_;
  std::vector<Blocker> blockers_;
};

}  // namespace cohort
