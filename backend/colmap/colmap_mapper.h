#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "backend/colmap/tracks_to_database.h"
#include "backend/scene/reconstruction.h"

namespace cohort {

struct ColmapOptions {
  std::string program = "colmap";  // a path, or a name in PATH
  int seed = 0;
  int threads = 1;              // with more threads faster, but not reproducible
  double max_minutes = 1440.0;  // of one run of the program
  int max_attempts = 3;
  bool fewer_adjustments = true;
  bool final_adjustment = true;
  ColmapDatabaseOptions database;
  // The guessed camera was refined in another model and is kept. Set by the program; not an option
  // of the command.
  bool hold_guess = false;
  // The focal length of a frame divided by that of the tracks' camera, from the same model.
  FocalScales focal_scale;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("program",
           o.program,
           "The colmap program: a path, or a name in PATH. A wrapper script must start COLMAP by "
           "exec, since only the started process itself is killed at the time limit or together "
           "with cohort.",
           Tier::kCommon);
    v.Number("seed",
             o.seed,
             0,
             2147483647,
             "The seed of COLMAP's random numbers; another seed gives a slightly different "
             "model.",
             Tier::kCommon);
    v.Number(
        "threads",
        o.threads,
        1,
        1024,
        "number of COLMAP's threads; more than one are faster, but the model is not reproducible");
    v.Number("max_minutes",
             o.max_minutes,
             0.0,
             1e6,
             "time limit of one run of COLMAP [min]; a run that exceeds it is killed and counts as "
             "an error; 0: no limit");
    v.Number("max_attempts",
             o.max_attempts,
             1,
             100,
             "number of cohort's initial pairs to try until 80 % of the frames register; the last "
             "attempt leaves the choice to COLMAP");
    v.Flag("fewer_adjustments",
           o.fewer_adjustments,
           "run a global bundle adjustment whenever the model has grown by 40 %; off: by 10 %, "
           "COLMAP's default");
    v.Flag("final_adjustment",
           o.final_adjustment,
           "run COLMAP's bundle_adjuster on the mapper's model after duplicate points have been "
           "removed");
    v.Group("database", o.database, "database for COLMAP", Tier::kExpert);
  }
};

struct ColmapResult {
  Reconstruction reconstruction;  // the model that registered the most frames; empty if none did
  ReconstructionSummary summary;  // `termination` describes the outcome in one line
  std::filesystem::path log;      // all that COLMAP printed
};

// Runs COLMAP's incremental mapper on tracks: own database, own initial pair (if fewer than 80 % of
// the frames register, the next best, and finally COLMAP's), options fit for video, known
// intrinsics kept. The registered frames decide the outcome, not COLMAP's exit code. If a feature
// has two points (one from false matches, which can bend a camera), one is kept, and COLMAP's
// bundle_adjuster runs once more to the optimum. `work_folder` is created if missing and keeps
// database.db, the log and COLMAP's models; it replaces what an earlier run left there. A clip that
// does not reconstruct is a result that states why. Throws Error if there is no usable colmap
// program or work_folder cannot be written.
ColmapResult ReconstructWithColmap(const TrackFile& tracked,
                                   const ColmapOptions& options,
                                   const std::filesystem::path& work_folder);

// Runs only COLMAP's bundle_adjuster, from another program's model of the same tracks (its point
// ids are the tracks'), to the optimum of COLMAP's cost. It uses those of the model's views that
// the mapper would get too (WithoutWeakObservations) and whose error is within its bound, with
// equal weights. The result is empty if COLMAP fails.
ColmapResult AdjustWithColmap(const TrackFile& tracked,
                              const Reconstruction& start,
                              const ColmapOptions& options,
                              const std::filesystem::path& work_folder);

}  // namespace cohort
