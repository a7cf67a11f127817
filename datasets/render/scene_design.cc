#include "datasets/render/scene_design.h"

#include "datasets/render/scenes.h"
#include "frontend/core/error.h"

namespace cohort {
namespace {

using BuildScene = void (*)(SceneBuilder&);

BuildScene Recipe(SceneName scene) {
  switch (scene) {
    case SceneName::kRoom:
      return BuildRoom;
    case SceneName::kCorridor:
      return BuildCorridor;
    case SceneName::kStreet:
      return BuildStreet;
    case SceneName::kTabletop:
      return BuildTabletop;
    case SceneName::kFacade:
      return BuildFacade;
    case SceneName::kShelves:
      return BuildShelves;
    case SceneName::kBodies:
      return BuildBodies;
    case SceneName::kCloth:
      return BuildCloth;
  }
  ThrowError("no such scene");
}

}  // namespace

SceneDesign DesignScene(SceneName scene, unsigned seed, double focal_px) {
  SceneBuilder builder(seed, focal_px);
  Recipe(scene)(builder);
  return builder.Finish();
}

}  // namespace cohort
