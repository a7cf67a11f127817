#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "backend/colmap/colmap_mapper.h"
#include "backend/scene/mapper.h"
#include "pipelines/console/command.h"

namespace cohort {

enum class BackendKind { kCeres, kColmap };
inline constexpr ChoiceNames<BackendKind, 2> kBackendNames{
    {{"ceres", BackendKind::kCeres}, {"colmap", BackendKind::kColmap}}};

struct ReconstructCommandOptions {
  std::string tracks;
  std::string out;
  std::string json;
  BackendKind backend = BackendKind::kCeres;
  bool write_frames = true;
  MapperOptions ceres;
  ColmapOptions colmap;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("tracks", o.tracks, "The .tracks file to reconstruct.", Tier::kCommon);
    v.Text("out", o.out, "The model folder to write.", Tier::kCommon);
    v.Text("json", o.json, "Write the figures of the run to this file, too.", Tier::kCommon);
    v.Choice("backend",
             o.backend,
             kBackendNames,
             "What reconstructs: ceres is built in and weighs every position by how sure the"
             " tracker is of it; colmap runs the program COLMAP.",
             Tier::kCommon);
    v.Flag("write_frames",
           o.write_frames,
           "Of a video, write the frames as pictures beside COLMAP's database, for "
           "COLMAP's own tools.",
           Tier::kCommon);
    v.Group("ceres", o.ceres, "backend ceres");
    v.Group("colmap", o.colmap, "backend colmap");
  }
};

// What summary.json says of any model: the summary, and which frames it was to have.
nlohmann::ordered_json SummaryToJson(const ReconstructionSummary& summary,
                                     const std::vector<FrameInfo>& frames);

// .tracks -> model folder. A clip that does not reconstruct is a result, which says why.
ReconstructionSummary ReconstructTracks(const ReconstructCommandOptions& options);

// The same, printed; throws Error after writing all there is where fewer than 80 % of the frames
// registered: a part of a clip is no reconstruction of it.
void RunReconstruct(const ReconstructCommandOptions& options);

Command ReconstructCommand();

}  // namespace cohort
