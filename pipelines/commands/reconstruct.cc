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

// "first:end:stride", as FrameRange reads it: evaluation must know which frames are missing.
std::string RangeOf(const std::vector<FrameInfo>& frames) {
  if (frames.empty()) return "0:0";
  const std::uint32_t first = ToInt(frames.front().index);
  const std::uint32_t stride = frames.size() > 1 ? ToInt(frames[1].index) - first : 1;
  return fmt::format("{}:{}:{}", first, ToInt(frames.back().index) + 1, stride);
}

nlohmann::ordered_json SummaryToJson(const ReconstructionSummary& summary,
                                     const TrackFile& file,
                                     const ReconstructCommandOptions& options) {
  return {{"backend", NameOf(kBackendNames, options.backend)},
          {"registered", summary.registered},
          {"frames", summary.frames},
          {"frame_range", RangeOf(file.frames)},
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

struct Outcome {
  Reconstruction reconstruction;  // empty: there is none
  ReconstructionSummary summary;
};

Outcome ReconstructByCeres(const TrackFile& file, const ReconstructCommandOptions& options) {
  MapperResult result = ReconstructWithCeres(file, options.ceres);
  return {std::move(result.reconstruction), std::move(result.summary)};
}

Outcome ReconstructByColmap(TrackFile file,
                            const ReconstructCommandOptions& options,
                            const fs::path& work_dir) {
  if (file.image_root.empty() && options.write_frames) {
    fs::create_directory(work_dir);
    WriteVideoFrames(file, work_dir / "images");
    file.image_root = (work_dir / "images").string();
  }
  ColmapResult result = ReconstructWithColmap(file, options.colmap, work_dir);
  return {std::move(result.reconstruction), std::move(result.summary)};
}

Outcome Reconstruct(const TrackFile& file,
                    const ReconstructCommandOptions& options,
                    const fs::path& folder) {
  switch (options.backend) {
    case BackendKind::kCeres:
      return ReconstructByCeres(file, options);
    case BackendKind::kColmap:
      return ReconstructByColmap(file, options, folder / "colmap");
  }
  ThrowUsageError("unknown backend");
}

}  // namespace

ReconstructionSummary ReconstructTracks(const ReconstructCommandOptions& options) {
  const TrackFile file = ReadTrackFile(options.tracks);
  if (!file.complete) {
    spdlog::warn(
        "{}: tracking was interrupted; it holds {} frames", options.tracks, file.frames.size());
  }
  OutputFolder out(options.out, ModelFolderNames());
  spdlog::info("{} reconstructs {} frames, {} tracks ...",
               NameOf(kBackendNames, options.backend),
               file.frames.size(),
               file.tracks.features().size());
  const auto [reconstruction, summary] = Reconstruct(file, options, out.partial());

  if (!reconstruction.cam_from_world.empty()) {
    WriteReconstructionFiles(out.partial(), reconstruction);
  }
  const nlohmann::ordered_json json = SummaryToJson(summary, file, options);
  WriteJsonFile(out.partial() / "summary.json", json);
  out.Commit();
  if (!options.json.empty()) WriteJsonFile(options.json, json);
  return summary;
}

void RunReconstruct(const ReconstructCommandOptions& options) {
  const ReconstructionSummary summary = ReconstructTracks(options);
  PrintSummary(summary, options.out);
  if (summary.Failed()) {
    ThrowError(
        "the reconstruction failed: {} of {} frames registered, fewer than 80 % ({}); what "
        "there is lies in {}",
        summary.registered,
        summary.frames,
        summary.termination,
        options.out);
  }
}

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
