// scene.json, that says what a rendered clip's scene was.
#include "datasets/render/synthetic_scene.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  File("scene.json", bytes);
  Try([&] { ReadSceneFile(Folder()); });
}

}  // namespace cohort::fuzz
