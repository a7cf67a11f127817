#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "frontend/storage/write_lock.h"
#include "pipelines/jobs/reconstruct_job.h"
#include "pipelines/jobs/track_job.h"
#include "pipelines/sfm/film_advice.h"
#include "pipelines/sfm/scene.h"

namespace cohort {

// The work of `cohort sfm`.
struct SfmJobOptions {
  SfmJobOptions() { reconstruct.ceres.covariances = true; }

  InputOptions input;
  std::string out;
  MaskOptions masks;
  std::string json;
  bool resume = false;
  int threads = 0;
  SceneOptions scene;
  TrackerOptions tracker;
  SecondPassOptions second_pass;
  ReconstructOptions reconstruct;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    InputOptions::Visit(o.input, v);
    v.Text("out", o.out, "The scene folder to write.", Tier::kCommon);
    SceneOptions::Visit(o.scene, v);
    MaskOptions::Visit(o.masks, v);
    v.Text("json",
           o.json,
           "Also write the figures of the run, the scene's summary.json, to this file.",
           Tier::kCommon);
    v.Flag("resume",
           o.resume,
           "Continue an interrupted run with the same options instead of starting again.",
           Tier::kCommon);
    v.Number("threads",
             o.threads,
             0,
             1024,
             "The number of threads; 0: one per core. More threads are faster, and the scene stays "
             "the same.",
             Tier::kCommon);
    v.Group("track", o.tracker, "tracking, as in `cohort track`", Tier::kExpert);
    v.Group("second_pass", o.second_pass, "the second pass", Tier::kExpert);
    v.Group("model", o.reconstruct, "reconstruction, as in `cohort reconstruct`", Tier::kExpert);
  }
};

struct SfmFigures {
  ReconstructionSummary model;
  std::size_t images = 0;
  std::size_t points = 0;                // of the scene
  std::size_t points_added = 0;          // of these, to the points of the tracks
  std::string quality;                   // as in summary.json of the model
  std::optional<double> expected_error;  // of the cameras, share of the extent of their path
  std::optional<double> focal_px;        // of a camera that was not known
  std::optional<double> focal_sigma_px;
  std::optional<double> camera_uncertainty;  // share of the distance to the scene
  std::vector<Doubt> reasons;                // to doubt the model
  std::vector<std::string> notes;            // on the frames that do not show the scene
  std::vector<std::string> film_better;      // FilmAdvice
  std::optional<WriteLock> lock;             // of the scene: held until its page is written
};

// Makes a scene folder from INPUT (docs/files.md): clip.tracks by RunTrackJob, model/ by
// RunReconstructJob, and the scene by WriteScene, each whole or not at all. With `resume` finished
// stages of the same input and options are kept. A clip without a model is a result, whose
// summary.json states why.
SfmFigures RunSfmJob(const SfmJobOptions& options);

}  // namespace cohort
