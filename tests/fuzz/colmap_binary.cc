// COLMAP's model as binary: cameras, images, points3D and our trajectory.tum.
#include "backend/colmap/colmap_tracks.h"
#include "backend/colmap/model_io.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  const auto parts = Split(bytes, 4);
  File("cameras.bin", parts[0]);
  File("images.bin", parts[1]);
  File("points3D.bin", parts[2]);
  File("trajectory.tum", parts[3]);
  Try([&] {
    const ColmapModel model = ReadColmapModel(Folder());
    Try([&] { TracksOfColmapModel(model, Frames(), Folder()); });
    Try([&] { WriteReconstruction(Folder() / "again", FromColmapModel(model)); });
    Try([&] { ReadReconstruction(Folder()); });
  });
}

}  // namespace cohort::fuzz
