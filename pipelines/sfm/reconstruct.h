#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "backend/colmap/colmap_mapper.h"
#include "backend/mapper/mapper.h"
#include "pipelines/sfm/progress.h"

namespace cohort {

enum class BackendKind { kCeres, kColmap };
inline constexpr ChoiceNames<BackendKind, 2> kBackendNames{
    {{"ceres", BackendKind::kCeres}, {"colmap", BackendKind::kColmap}}};

struct ReconstructOptions {
  BackendKind backend = BackendKind::kCeres;
  bool write_frames = true;
  bool global_shutter = true;
  bool ceres_start = true;
  MapperOptions ceres;
  ColmapOptions colmap;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice("backend",
             o.backend,
             kBackendNames,
             "The backend: ceres is built in and weights every position by its uncertainty; colmap "
             "runs the program COLMAP.",
             Tier::kCommon);
    v.Flag("write_frames",
           o.write_frames,
           "For a video, write the frames as pictures beside COLMAP's database, for COLMAP's own "
           "tools.",
           Tier::kCommon);
    v.Flag("global_shutter",
           o.global_shutter,
           "If Ceres finds a rolling shutter, give COLMAP, which has no model of it, the positions "
           "as a global shutter would have seen them.",
           Tier::kCommon);
    v.Flag("ceres_start",
           o.ceres_start,
           "If COLMAP's mapper fails, or its model fits the tracks much worse than that of Ceres, "
           "run COLMAP's bundle adjuster from the model of Ceres instead. If the camera is a "
           "guess, use the camera that Ceres found and keep it fixed.",
           Tier::kCommon);
    v.Group("ceres", o.ceres, "backend ceres");
    v.Group("colmap", o.colmap, "backend colmap");
  }
};

struct ReconstructResult {
  Reconstruction reconstruction;      // empty if there is none; the summary states why
  ReconstructionSummary summary;      // summary.Failed(): fewer than 80 % of the frames registered
  std::vector<std::string> warnings;  // lines for the user
  std::optional<CeresFindings> ceres;
};

ReconstructResult ToReconstructResult(MapperResult model);
// tracks_without_point.csv, the covariances and other_parts/ of a model folder.
void WriteCeresFindings(const CeresFindings& findings,
                        const TrackFile& file,
                        const std::filesystem::path& existing_folder);

// Reconstructs cameras and points from tracks, by either backend. A clip that does not reconstruct
// is a result.
//
//   const ReconstructResult result = Reconstruct(TrackSequence(*clip), {});
//   std::cout << result.summary.Brief() << "\n";
//   WriteReconstruction("model", result.reconstruction);    // COLMAP's files; model_io.h
//
// COLMAP works in `colmap_folder`, which keeps its database, log and models, or without one in a
// temporary folder. Throws Error if the program `colmap` is missing.
ReconstructResult Reconstruct(const TrackFile& file,
                              const ReconstructOptions& options = {},
                              const std::filesystem::path& colmap_folder = {},
                              const StageProgress& progress = {});

// A model folder's model, with the readout of its summary.json; another program's model has none.
Reconstruction ReadModelFolder(const std::filesystem::path& folder);

// Writes what ReadModelFolder reads, whole or not at all; `summary`: JSON for the model's
// summary.json, {} for none.
void WriteModelFolder(const Reconstruction& model,
                      const std::string& summary,
                      const std::filesystem::path& folder);

// The same into a model folder: the model's files and summary.json (docs/files.md), and for Ceres
// tracks_without_point.csv and the covariances. Whole or not at all. `summary_options`: JSON for
// the options in summary.json; empty: `options`.
ReconstructResult ReconstructIntoFolder(const TrackFile& file,
                                        const ReconstructOptions& options,
                                        const std::filesystem::path& folder,
                                        const StageProgress& progress = {},
                                        const std::string& summary_options = {});

}  // namespace cohort
