#include "pipelines/commands/degrade.h"

#include <spdlog/spdlog.h>

#include "pipelines/console/progress_bar.h"

namespace cohort {

void RunDegrade(const DegradeCommandOptions& options) {
  DegradeOptions degrade = options.degrade;
  degrade.level = ParseLevel(options.level);
  const auto sequence = OpenInput(options.input);
  ProgressBar progress("degrade", sequence->FrameCount());
  DegradeSequence(
      *sequence, options.input.input, degrade, options.out, [&](std::size_t, std::size_t) {
        progress.Advance();
      });
  if (!sequence->Warning().empty()) spdlog::warn("{}", sequence->Warning());
}

Command DegradeCommand() {
  return MakeCommand({.name = "degrade",
                      .usage = "INPUT OUT [options]",
                      .summary = "Darken a clip and add noise",
                      .positionals = {"input", "out"},
                      .required = {"input", "out"},
                      .short_flags = {{"occluder", {"occluder_px_per_frame"}}}},
                     RunDegrade);
}

}  // namespace cohort
