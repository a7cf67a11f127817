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
  int threads = 1;              // more: faster, and not the same twice
  double max_minutes = 1440.0;  // of one run of the program
  int max_attempts = 3;
  bool fewer_adjustments = true;
  bool final_adjustment = true;
  ColmapDatabaseOptions database;
  // The guessed camera is another model's refined one, and is kept. Set by the program, no option of
  // the command.
  bool hold_guess = false;
  // By how much the focal length of a frame is that of the tracks' camera, of the same other model.
  FocalScales focal_scale;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text(
        "program",
        o.program,
        "The colmap program: a path, or a name in PATH. A script that runs it must do so by exec: "
        "only the program itself is killed at its time limit, or with us.",
        Tier::kCommon);
    v.Number("seed",
             o.seed,
             0,
             2147483647,
             "The seed of COLMAP's random numbers; another seed gives a slightly different "
             "model.",
             Tier::kCommon);
    v.Number("threads",
             o.threads,
             1,
             1024,
             "threads of COLMAP; more than one are faster and do not give the same model twice");
    v.Number("max_minutes",
             o.max_minutes,
             0.0,
             1e6,
             "minutes that one run of COLMAP may take until it is killed, an error; 0: no limit");
    v.Number("max_attempts",
             o.max_attempts,
             1,
             100,
             "initial pairs of ours to try until 80 % of the frames register; then COLMAP's");
    v.Flag(
        "fewer_adjustments",
        o.fewer_adjustments,
        "adjust the whole model after 40 % of growth; off: after 10 %, as COLMAP does by itself");
    v.Flag("final_adjustment",
           o.final_adjustment,
           "run COLMAP's bundle_adjuster on the mapper's model without double points");
    v.Group("database", o.database, "the database that COLMAP gets", Tier::kExpert);
  }
};

struct ColmapResult {
  Reconstruction reconstruction;  // the model that registered most frames; empty: none did
  ReconstructionSummary summary;  // `termination` says what happened, in one line
  double colmap_seconds = 0.0;    // of summary.seconds, in the colmap program
  std::filesystem::path log;      // all that COLMAP printed
};

// Hands tracks to COLMAP's incremental mapper: own database, own initial pair (then the next best
// and at last COLMAP's, where fewer than 80 % of the frames register), options fit for video,
// intrinsics kept where they are known. What counts is what registered: COLMAP's exit code says
// nothing of that. Of a feature that it gave two points (one of them of false matches, which can
// bend a camera) one is kept, and COLMAP's bundle_adjuster runs once more to the optimum.
// `work_folder` is made if missing and keeps database.db, the log and COLMAP's models; what an earlier
// run left there is replaced. A clip that does not reconstruct is a result that says why; throws
// Error without a usable colmap program or where work_folder cannot be written.
ColmapResult ReconstructWithColmap(const TrackFile& tracked,
                                   const ColmapOptions& options,
                                   const std::filesystem::path& work_folder);

// COLMAP's bundle_adjuster alone, from a model of the same tracks by another program (ids of its
// points are the tracks'), to the optimum of COLMAP's cost: of the model's views those that its
// mapper would get, too (WithoutWeakObservations; predicted ones only if asked for), and not off by
// more than its bound, weighed alike. Empty where COLMAP fails.
ColmapResult AdjustWithColmap(const TrackFile& tracked,
                              const Reconstruction& start,
                              const ColmapOptions& options,
                              const std::filesystem::path& work_folder);

// Points alone, by COLMAP's point_triangulator from poses that are given and kept (true ones:
// isolates the tracks from the solver). All frames with a pose count as registered; the camera of
// `tracked` must be known.
ColmapResult TriangulateWithColmap(const TrackFile& tracked,
                                   const std::map<FrameIndex, Rigid3>& cam_from_world,
                                   const ColmapOptions& options,
                                   const std::filesystem::path& work_folder);

}  // namespace cohort
