#pragma once

#include "datasets/render/scene_geometry.h"

namespace cohort {

// The surfaces of a scene by its name. The seed varies position, size and paint of things, not the
// scene's character. Textures have about one texel per pixel of a camera of this focal length.
SceneDesign DesignScene(SceneName scene, unsigned seed, double focal_px);

}  // namespace cohort
