#include "pipelines/commands/reconstruct.h"

#include <spdlog/spdlog.h>

#include <nlohmann/json.hpp>

#include "backend/colmap/model_io.h"
#include "frontend/core/output.h"
#include "pipelines/commands/video_frames.h"
#include "pipelines/console/table.h"
#include "pipelines/json/json_file.h"

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

void PrintSummary(const ReconstructionSummary& summary, const std::string& out) {
  fmt::print("{}",
             AlignedTable({{"model", out},
                           {"registered", fmt::format("{}/{}", summary.registered, summary.frames)},
                           {"points", fmt::format("{}", summary.points)},
                           {"observations", fmt::format("{}", summary.observations)},
                           {"mean track length", fmt::format("{:.1f}", summary.mean_track_length)},
                           {"mean reprojection error [px]",
                            fmt::format("{:.3f}", summary.mean_reprojection_px)},
                           {"seconds", fmt::format("{:.1f}", summary.seconds)},
                           {"ended with", summary.termination}}));
}

struct Outcome {
  Reconstruction reconstruction;  // empty: there is none
  ReconstructionSummary summary;
  nlohmann::ordered_json more =
      nlohmann::ordered_json::object();  // for summary.json, of this backend alone
};

nlohmann::ordered_json ToJson(const Camera& c) {
  return {{"fx", c.fx},
          {"fy", c.fy},
          {"cx", c.cx},
          {"cy", c.cy},
          {"k1", c.k1},
          {"k2", c.k2},
          {"p1", c.p1},
          {"p2", c.p2}};
}

// Upper triangle, row by row.
template <typename Matrix>
std::string CovarianceRow(std::uint32_t id, const Matrix& covariance) {
  std::string row = fmt::format("{}", id);
  for (int i = 0; i < covariance.rows(); ++i) {
    for (int j = i; j < covariance.cols(); ++j) row += fmt::format(",{:.6g}", covariance(i, j));
  }
  return row + "\n";
}

std::string CovarianceHeader(const std::string& id, const std::vector<std::string>& names) {
  std::string header = id;
  for (std::size_t i = 0; i < names.size(); ++i) {
    for (std::size_t j = i; j < names.size(); ++j) header += "," + names[i] + "_" + names[j];
  }
  return header + "\n";
}

void WriteCovariances(const MapperResult& result, const fs::path& folder) {
  std::string cameras = CovarianceHeader("frame", {"wx", "wy", "wz", "cx", "cy", "cz"});
  for (const auto& [frame, covariance] : result.camera_covariances) {
    cameras += CovarianceRow(ToInt(frame), covariance);
  }
  std::string points = CovarianceHeader("track_id", {"x", "y", "z"});
  for (const auto& [feature, covariance] : result.point_covariances) {
    points += CovarianceRow(ToInt(feature), covariance);
  }
  WriteBytes(folder / "camera_covariances.csv", cameras);
  WriteBytes(folder / "point_covariances.csv", points);
}

Outcome ReconstructByCeres(const TrackFile& file,
                           const ReconstructCommandOptions& options,
                           const fs::path& folder) {
  MapperResult result = ReconstructWithCeres(file, options.ceres);
  for (const std::string& warning : result.warnings) spdlog::warn("{}", warning);
  std::string without_point = "track_id,observations\n";
  for (const FeatureId feature : result.without_point) {
    without_point += fmt::format("{},{}\n", ToInt(feature), file.tracks.Track(feature).size());
  }
  WriteBytes(folder / "tracks_without_point.csv", without_point);
  if (!result.camera_covariances.empty()) WriteCovariances(result, folder);

  Outcome outcome;
  outcome.more["tracks_without_point"] = result.without_point.size();
  if (!result.reconstruction.cam_from_world.empty()) {
    outcome.more["noise"] = result.noise;
    outcome.more["camera"] = ToJson(result.reconstruction.camera);
  }
  if (result.better_camera) outcome.more["better_camera"] = ToJson(*result.better_camera);
  for (const OtherComponent& part : result.other_components) {
    outcome.more["other_parts"].push_back({{"first_frame", ToInt(part.first)},
                                           {"last_frame", ToInt(part.last)},
                                           {"registered", part.registered},
                                           {"points", part.points}});
  }
  outcome.reconstruction = std::move(result.reconstruction);
  outcome.summary = std::move(result.summary);
  return outcome;
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
      return ReconstructByCeres(file, options, folder);
    case BackendKind::kColmap:
      return ReconstructByColmap(file, options, folder / "colmap");
  }
  ThrowUsageError("unknown backend");
}

}  // namespace

nlohmann::ordered_json SummaryToJson(const ReconstructionSummary& summary,
                                     const std::vector<FrameInfo>& frames) {
  return {{"registered", summary.registered},
          {"frames", summary.frames},
          {"frame_range", RangeOf(frames)},
          {"failed", summary.Failed()},
          {"points", summary.points},
          {"observations", summary.observations},
          {"mean_track_length", summary.mean_track_length},
          {"mean_reprojection_px", summary.mean_reprojection_px},
          {"seconds", summary.seconds},
          {"termination", summary.termination}};
}

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
  const auto [reconstruction, summary, more] = Reconstruct(file, options, out.partial());

  if (!reconstruction.cam_from_world.empty()) {
    WriteReconstructionFiles(out.partial(), reconstruction);
  }
  nlohmann::ordered_json json{{"backend", NameOf(kBackendNames, options.backend)}};
  json.update(SummaryToJson(summary, file.frames));
  json["options"] = ToJson(options);
  json.update(more);
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
