#include "pipelines/commands/degrade.h"

#include "pipelines/experiment/degrade_clip.h"

namespace cohort {

Command DegradeCommand() {
  return MakeCommand({.name = "degrade",
                      .usage = "INPUT OUT [options]",
                      .summary = "Darken a clip and add noise",
                      .positionals = {"input", "out"},
                      .required = {"input", "out"},
                      .short_flags = {{"occluder", {"occluder_px_per_frame"}}}},
                     DegradeClip);
}

}  // namespace cohort
