#pragma once

#include "datasets/render/synthetic_scene.h"
#include "pipelines/console/command.h"

namespace cohort {

struct SynthCommandOptions {
  std::string out;
  SyntheticSceneOptions scene;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("out", o.out, "The folder to write, in TUM RGB-D layout.", Tier::kCommon);
    SyntheticSceneOptions::Visit(o.scene, v);
  }
};

// Renders a clip with exact truth.
void RunSynth(const SynthCommandOptions& options);

Command SynthCommand();

}  // namespace cohort
