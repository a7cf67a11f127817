#include "pipelines/commands/all_commands.h"

#include "pipelines/commands/compare.h"
#include "pipelines/commands/degrade.h"
#include "pipelines/commands/evaluate.h"
#include "pipelines/commands/export.h"
#include "pipelines/commands/import.h"
#include "pipelines/commands/reconstruct.h"
#include "pipelines/commands/refine.h"
#include "pipelines/commands/sfm.h"
#include "pipelines/commands/show.h"
#include "pipelines/commands/synth.h"
#include "pipelines/commands/track.h"

namespace cohort {

std::vector<Command> AllCommands() {
  return {SfmCommand(),
          TrackCommand(),
          ImportCommand(),
          ExportCommand(),
          ReconstructCommand(),
          RefineCommand(),
          ShowCommand(),
          EvaluateCommand(),
          SynthCommand(),
          DegradeCommand(),
          CompareCommand()};
}

}  // namespace cohort
