#pragma once

#include <string>

#include "pipelines/console/command.h"
#include "pipelines/sfm/reconstruct_file.h"
#include "pipelines/sfm/scene.h"
#include "pipelines/sfm/track_clip.h"

namespace cohort {

struct SfmOptions {
  std::string out;
  std::string json;
  bool resume = false;
  SceneOptions scene;
  // Their files are those of the scene folder.
  TrackClipOptions track;
  ReconstructFileOptions model;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    InputOptions::Visit(o.track.input, v);
    v.Text("out", o.out, "The scene folder to write.", Tier::kCommon);
    SceneOptions::Visit(o.scene, v);
    MaskOptions::Visit(o.track.masks, v);
    v.Text("json",
           o.json,
           "Also write the figures of the run, the scene's summary.json, to this file.",
           Tier::kCommon);
    v.Flag("resume",
           o.resume,
           "Continue an interrupted run with the same options instead of starting again.",
           Tier::kCommon);
    v.Number("threads",
             o.track.threads,
             0,
             1024,
             "The number of threads; 0: one per core. More threads are faster, and the scene stays "
             "the same.",
             Tier::kCommon);
    v.Group("track", o.track.tracker, "tracking, as in `cohort track`", Tier::kExpert);
    v.Group("second_pass", o.track.second_pass, "the second pass", Tier::kExpert);
    v.Group(
        "model", o.model.reconstruct, "reconstruction, as in `cohort reconstruct`", Tier::kExpert);
  }
};

// Makes a scene folder from INPUT (docs/files.md): clip.tracks by TrackClip, model/ by
// ReconstructFile, and the scene by WriteScene, each whole or not at all; then report.html. With
// `resume` finished stages of the same input and options are kept. Prints the scene's quality in
// words. If fewer than 80 % of the frames registered, it writes all results, with the reason in
// summary.json, and then throws Error.
void RunSfm(const SfmOptions& options);

Command SfmCommand();

}  // namespace cohort
