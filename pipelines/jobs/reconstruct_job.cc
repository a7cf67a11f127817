#include "pipelines/jobs/reconstruct_job.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "frontend/storage/output.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/jobs/idle_options.h"
#include "pipelines/jobs/track_doubts.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"

namespace cohort {

ReconstructionSummary RunReconstructJob(const ReconstructJobOptions& options) {
  const TrackFile file = ReadTrackFile(options.tracks);
  CheckOutputsGiven({options.json});
  WarnOfIdleOptions(options.reconstruct);
  if (options.reconstruct.backend == BackendKind::kColmap && options.reconstruct.write_frames) {
    WarnIfVideoChanged(file, options.tracks);
  }
  spdlog::info("{} reconstructs {} frames, {} tracks ...",
               NameOf(kBackendNames, options.reconstruct.backend),
               file.frames.size(),
               file.tracks.features().size());
  const ReconstructResult result = ReconstructIntoFolder(
      file, options.reconstruct, options.out, ProgressBars(), JsonLine(ToJson(options)));
  if (result.reconstruction.readout != 0.0) {
    spdlog::info("rolling shutter: the readout takes {:.2f} of the time between frames",
                 result.reconstruction.readout);
  }
  for (const Aside& aside : result.summary.asides) {
    spdlog::info("{}", DescribeAside(aside));
  }
  for (const std::string& warning : result.warnings) spdlog::warn("{}", warning);
  if (!options.json.empty()) {
    WriteJsonFile(options.json, ReadJsonFile(std::filesystem::path(options.out) / "summary.json"));
  }
  return result.summary;
}

}  // namespace cohort
