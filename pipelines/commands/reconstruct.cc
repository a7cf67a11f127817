#include "pipelines/commands/reconstruct.h"

#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>

#include "backend/colmap/model_io.h"
#include "frontend/core/output.h"
#include "pipelines/commands/video_frames.h"
#include "pipelines/console/json_file.h"
#include "pipelines/console/table.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

nlohmann::ordered_json SummaryToJson(const ReconstructionSummary& summary,
                                     const ReconstructCommandOptions& options) {
  return {{"backend", NameOf(kBackendNames, options.backend)},
          {"registered", summary.registered},
          {"frames", summary.frames},
          {"failed", summary.Failed()},
          {"points", summary.points},
          {"observations", summary.observations},
          {"mean_track_length", summary.mean_track_length},
          {"mean_reprojection_px", summary.mean_reprojection_px},
          {"seconds", summary.seconds},
          {"termination", summary.termination},
          {"options", ToJson(options)}};
}

void PrintSummary(const ReconstructionSummary& summary, const std::string& out) {
  fmt::print("{}",
             AlignedTable({{"model", out},
                           {"registered", fmt::format("{}/{}", summary.registered, summary.frames)},
                           {"points", fmt::format("{}", summary.points)},
                           {"observations", fmt::format("{}", summary.observations)},
                           {"mean track length", fmt::format("{:.1f}", summary.mean_track_length)},
                           {"mean reprojection error [px]",
                            fmt::format("{:.3f}", summary.mean_reprojection_px)},
                           {"seconds", fmt::format("{:.1f}", summary.seconds)}}));
}

}  // namespace

void RunReconstruct(const ReconstructCommandOptions& options) {
  TrackFile file = ReadTrackFile(options.tracks);
  OutputFolder out(options.out, ModelFolderNames());
  const fs::path work_dir = out.partial() / "colmap";
  if (file.image_root.empty() && options.write_frames) {
    fs::create_directory(work_dir);
    WriteVideoFrames(file, work_dir / "images");
    file.image_root = (work_dir / "images").string();
  }
  spdlog::info("colmap reconstructs {} frames, {} tracks ...",
               file.frames.size(),
               file.tracks.features().size());
  const ColmapResult result = ReconstructWithColmap(file, options.colmap, work_dir);
  const ReconstructionSummary& summary = result.summary;

  if (!result.reconstruction.cam_from_world.empty()) {
    WriteReconstructionFiles(out.partial(), result.reconstruction);
  }
  const nlohmann::ordered_json json = SummaryToJson(summary, options);
  WriteJsonFile(out.partial() / "summary.json", json);
  out.Commit();
  if (!options.json.empty()) WriteJsonFile(options.json, json);
  PrintSummary(summary, options.out);
  if (summary.Failed()) {
    ThrowError(
        "the reconstruction failed: {} of {} frames registered, fewer than 80 % ({}); what "
        "there is and COLMAP's log are in {}",
        summary.registered,
        summary.frames,
        summary.termination,
        options.out);
  }
}

Command ReconstructCommand() {
  return MakeCommand(
      {.name = "reconstruct",
       .usage = "F.tracks --out DIR [options]",
       .summary = "Reconstruct cameras and points from tracks",
       .positionals = {"tracks"},
       .required = {"tracks", "out"},
       .short_flags = {{"colmap-program", {"colmap.program"}}, {"seed", {"colmap.seed"}}}},
      RunReconstruct);
}

}  // namespace cohort
