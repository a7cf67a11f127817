#pragma once

#include "datasets/render/scene_builder.h"

namespace cohort {

// The contents, viewpoint and light of each scene. The seed varies position, size and paint of
// things, not the scene's character. A new scene is a function here, a name in synthetic_scene.h
// and a line in scene_design.cc.
void BuildRoom(SceneBuilder& b);
void BuildCorridor(SceneBuilder& b);
void BuildTabletop(SceneBuilder& b);
void BuildShelves(SceneBuilder& b);
void BuildBodies(SceneBuilder& b);  // a room in which three boxes wander
void BuildCloth(SceneBuilder& b);   // a room in which a cloth waves
void BuildStreet(SceneBuilder& b);
void BuildFacade(SceneBuilder& b);

}  // namespace cohort
