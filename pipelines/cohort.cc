#include "pipelines/commands/compare.h"
#include "pipelines/commands/degrade.h"
#include "pipelines/commands/evaluate.h"
#include "pipelines/commands/export.h"
#include "pipelines/commands/import.h"
#include "pipelines/commands/reconstruct.h"
#include "pipelines/commands/refine.h"
#include "pipelines/commands/synth.h"
#include "pipelines/commands/track.h"

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  return cohort::RunProgram({cohort::TrackCommand(),
                             cohort::ImportCommand(),
                             cohort::ExportCommand(),
                             cohort::ReconstructCommand(),
                             cohort::RefineCommand(),
                             cohort::EvaluateCommand(),
                             cohort::SynthCommand(),
                             cohort::DegradeCommand(),
                             cohort::CompareCommand()},
                            arguments);
}
