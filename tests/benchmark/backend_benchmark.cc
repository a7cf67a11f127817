// The Ceres backend against COLMAP's mapper on the same generated tracks, alternating, one thread
// each:   backend_benchmark [--frames 120] [--features 400] [--seeds 3] [--no-colmap]
// Times are processor seconds (of this process, of COLMAP as a child); camera errors (ATE, after
// the best similarity) are in thousandths of the scene's unit, the length of a path being about 2.
#include <fmt/format.h>
#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <vector>

#include "backend/colmap/colmap_mapper.h"
#include "backend/scene/incremental_mapper.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using test::CameraPath;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;

struct Case {
  const char* name;
  SyntheticTracksOptions options;
};

struct Run {
  std::size_t registered = 0;
  double ate = 0.0;
  double seconds = 0.0;
};

double CpuSeconds(int who) {
  rusage usage{};
  getrusage(who, &usage);
  const auto seconds = [](const timeval& t) { return t.tv_sec + 1e-6 * t.tv_usec; };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// Tracks of which about `features` are in sight in each frame.
SyntheticTracks MakeTracks(SyntheticTracksOptions options, int features) {
  options.points = 500;
  const SyntheticTracks probe = test::MakeSyntheticTracks(options);
  const double seen = static_cast<double>(probe.file.tracks.observations().size()) / options.frames;
  options.points = static_cast<int>(500.0 * features / seen);
  return test::MakeSyntheticTracks(options);
}

double Error(const Reconstruction& reconstruction, const SyntheticTracks& tracks) {
  if (reconstruction.cam_from_world.size() < 3) return std::nan("");
  return test::AbsoluteTrajectoryError(reconstruction.cam_from_world, tracks.cam_from_world);
}

Run RunCeres(const SyntheticTracks& tracks) {
  const double start = CpuSeconds(RUSAGE_SELF);
  const MapperResult result = ReconstructWithCeres(tracks.file);
  return {result.summary.registered,
          Error(result.reconstruction, tracks),
          CpuSeconds(RUSAGE_SELF) - start};
}

// COLMAP's mapper alone: one attempt, without our second bundle adjustment.
Run RunColmap(const SyntheticTracks& tracks) {
  const test::TempDir folder;
  ColmapOptions options;
  options.max_attempts = 1;
  options.final_adjustment = false;
  const double start = CpuSeconds(RUSAGE_CHILDREN);
  const ColmapResult result = ReconstructWithColmap(tracks.file, options, folder.path());
  return {result.summary.registered,
          Error(result.reconstruction, tracks),
          CpuSeconds(RUSAGE_CHILDREN) - start};
}

std::vector<Case> Cases(int frames) {
  const auto make = [frames](CameraPath path, double noise_px, double outliers, double missing) {
    SyntheticTracksOptions options;
    options.path = path;
    options.frames = frames;
    options.noise_px = noise_px;
    options.outlier_fraction = outliers;
    options.missing_fraction = missing;
    options.max_track_length = 40;
    return options;
  };
  SyntheticTracksOptions shallow = make(CameraPath::kLateral, 0.5, 0.0, 0.0);
  shallow.plane_relief = 0.05;
  return {{"arc", make(CameraPath::kArc, 0.5, 0.0, 0.0)},
          {"lateral", make(CameraPath::kLateral, 0.5, 0.0, 0.0)},
          {"forward", make(CameraPath::kForward, 0.5, 0.0, 0.0)},
          {"arc, 10 % wrong, 30 % missing, 1 px", make(CameraPath::kArc, 1.0, 0.1, 0.3)},
          {"forward, 10 % wrong, 30 % missing, 1 px", make(CameraPath::kForward, 1.0, 0.1, 0.3)},
          {"nearly planar", shallow}};
}

void Compare(int frames, int features, int seeds, bool with_colmap) {
  fmt::print("{:<42} {:>4} | {:>9} {:>8} {:>7} | {:>9} {:>8} {:>7} | {:>9} {:>8}\n",
             fmt::format("{} frames, {} features", frames, features),
             "seed",
             "ceres reg",
             "ATE",
             "cpu s",
             "colmap",
             "ATE",
             "cpu s",
             "ATE ratio",
             "speed");
  double log_ate = 0.0;
  double log_speed = 0.0;
  int compared = 0;
  for (Case& c : Cases(frames)) {
    for (int seed = 1; seed <= seeds; ++seed) {
      c.options.seed = static_cast<std::uint64_t>(seed);
      const SyntheticTracks tracks = MakeTracks(c.options, features);
      const Run ceres = RunCeres(tracks);
      fmt::print("{:<42} {:>4} | {:>9} {:>8.3f} {:>7.2f} |",
                 c.name,
                 seed,
                 ceres.registered,
                 1e3 * ceres.ate,
                 ceres.seconds);
      if (with_colmap) {
        const Run colmap = RunColmap(tracks);
        fmt::print(" {:>9} {:>8.3f} {:>7.2f} | {:>9.3f} {:>8.1f}",
                   colmap.registered,
                   1e3 * colmap.ate,
                   colmap.seconds,
                   ceres.ate / colmap.ate,
                   colmap.seconds / ceres.seconds);
        if (std::isfinite(ceres.ate) && std::isfinite(colmap.ate)) {
          log_ate += std::log(ceres.ate / colmap.ate);
          log_speed += std::log(colmap.seconds / ceres.seconds);
          ++compared;
        }
      }
      fmt::print("\n");
      std::fflush(stdout);
    }
  }
  if (compared > 0) {
    fmt::print("geometric mean of {}: camera error ratio {:.3f}, COLMAP's time / ours {:.1f}\n",
               compared,
               std::exp(log_ate / compared),
               std::exp(log_speed / compared));
  }
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  CLI::App app("The Ceres backend against COLMAP's mapper on the same tracks");
  int frames = 120;
  int features = 400;
  int seeds = 3;
  bool no_colmap = false;
  app.add_option("--frames", frames, "frames of a clip")->check(CLI::Range(3, 10000));
  app.add_option("--features", features, "tracks in sight in a frame")->check(CLI::Range(20, 5000));
  app.add_option("--seeds", seeds, "seeds of each geometry")->check(CLI::Range(1, 100));
  app.add_flag("--no-colmap", no_colmap, "our backend alone");
  CLI11_PARSE(app, argc, argv);
  cohort::Compare(frames, features, seeds, !no_colmap);
  return 0;
}
