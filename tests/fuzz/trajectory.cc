// Trajectories in TUM format, as `evaluate` reads them.
#include "frontend/geometry/camera_text.h"
#include "pipelines/evaluation/trajectory_error.h"
#include "tests/fuzz/target.h"

namespace cohort::fuzz {

void Run(std::string_view bytes) {
  Try([&] {
    const auto poses = ReadTumTrajectory(File("a.tum", bytes));
    AssociatePoses(poses, poses);
  });
}

}  // namespace cohort::fuzz
