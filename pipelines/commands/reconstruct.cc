#include "pipelines/commands/reconstruct.h"

#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"
#include "pipelines/sfm/reconstruct_file.h"

namespace cohort {
namespace {

void PrintSummary(const ReconstructionSummary& summary, const std::string& out) {
  fmt::print(
      "{}",
      AlignedTable(
          {{"model", out},
           {"registered", fmt::format("{}/{}", summary.registered, summary.SceneFrames())},
           {"points", fmt::format("{}", summary.points)},
           {"observations", fmt::format("{}", summary.observations)},
           {"mean track length", fmt::format("{:.1f}", summary.mean_track_length)},
           {"mean reprojection error [px]", fmt::format("{:.3f}", summary.mean_reprojection_px)},
           {"seconds", fmt::format("{:.1f}", summary.seconds)},
           {"ended with", summary.termination}}));
}

void RunReconstruct(const ReconstructFileOptions& options) {
  const ReconstructionSummary summary = ReconstructFile(options, ConsoleReport());
  PrintSummary(summary, options.out);
  if (summary.Failed()) {
    ThrowError("the reconstruction failed: {} ({}); partial results are in {}",
               summary.WhyFailed(),
               summary.termination,
               options.out);
  }
}

}  // namespace

Command ReconstructCommand() {
  return MakeCommand(
      {.name = "reconstruct",
       .usage = "F.tracks --backend ceres|colmap --out DIR [options]",
       .summary = "Reconstruct cameras and points from tracks",
       .positionals = {"tracks"},
       .required = {"tracks", "out"},
       .short_flags = {{"colmap-program", {"colmap.program"}}, {"seed", {"colmap.seed"}}}},
      RunReconstruct);
}

}  // namespace cohort
