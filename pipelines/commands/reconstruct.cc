#include "pipelines/commands/reconstruct.h"

#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"
#include "pipelines/sfm/reconstruct_file.h"

namespace cohort {
namespace {

void PrintFigures(const ReconstructResult& result, const std::string& out) {
  const ReconstructionSummary& summary = result.summary;
  std::vector<std::vector<std::string>> rows{
      {"model", out},
      {"registered", fmt::format("{}/{}", summary.registered, summary.SceneFrames())},
      {"points", fmt::format("{}", summary.points)},
      {"observations", fmt::format("{}", summary.observations)},
      {"mean track length", fmt::format("{:.1f}", summary.mean_track_length)},
      {"mean reprojection error [px]", fmt::format("{:.3f}", summary.mean_reprojection_px)},
      {"quality", std::string(NameOf(kModelQualityNames, summary.Quality()))}};
  if (result.ceres && result.ceres->expected_error) {
    rows.push_back({"expected error of the cameras",
                    fmt::format("{:.2g} % of the extent of their path",
                                100.0 * *result.ceres->expected_error)});
  }
  rows.push_back({"seconds", fmt::format("{:.1f}", summary.seconds)});
  rows.push_back({"ended with", summary.termination});
  fmt::print("{}", AlignedTable(rows));
}

void RunReconstruct(const ReconstructFileOptions& options) {
  const ReconstructResult result = ReconstructFile(options, ConsoleReport());
  PrintFigures(result, options.out);
  const ReconstructionSummary& summary = result.summary;
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
