#pragma once

#include "datasets/render/scene_geometry.h"

namespace cohort {

// The surfaces of a scene by its name. The seed moves, sizes and paints things differently; what
// makes the scene stays. Textures get a texel or so a pixel of a camera of this focal length.
SceneDesign DesignScene(SceneName scene, unsigned seed, double focal_px);

}  // namespace cohort
