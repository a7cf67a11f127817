#include "pipelines/commands/synth.h"

#include "pipelines/console/progress_bar.h"

namespace cohort {

void RunSynth(const SynthCommandOptions& options) {
  ProgressBar progress("render", options.scene.frames);
  RenderSequence(options.scene, options.out, [&](std::size_t, std::size_t) { progress.Advance(); });
}

Command SynthCommand() {
  return MakeCommand({.name = "synth",
                      .usage = "OUT [options]",
                      .summary = "Render a clip of a synthetic scene with exact truth",
                      .positionals = {"out"},
                      .required = {"out"}},
                     RunSynth);
}

}  // namespace cohort
