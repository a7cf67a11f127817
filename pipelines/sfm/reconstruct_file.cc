#include "pipelines/sfm/reconstruct_file.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "backend/scene/phrasebook.h"
#include "frontend/storage/output.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/doubts.h"
#include "pipelines/sfm/idle_options.h"

namespace cohort {

ReconstructResult ReconstructFile(const ReconstructFileOptions& options, const JobReport& report) {
  const TrackFile file = ReadTrackFile(options.tracks);
  CheckOutputsGiven({options.json});
  report.Warn(DescribeIdleOptions(options.reconstruct));
  if (options.reconstruct.backend == BackendKind::kColmap && options.reconstruct.write_frames) {
    report.Warn(DoubtOfVideo(file, options.tracks));
  }
  report.Tell(fmt::format("{} reconstructs {} frames, {} tracks ...",
                          NameOf(kBackendNames, options.reconstruct.backend),
                          file.frames.size(),
                          file.tracks.features().size()));
  ReconstructResult result = ReconstructIntoFolder(
      file, options.reconstruct, options.out, report.progress, JsonLine(ToJson(options)));
  if (result.reconstruction.readout != 0.0) {
    report.Tell(fmt::format("rolling shutter: the readout takes {:.2f} of the time between frames",
                            result.reconstruction.readout));
  }
  for (const Aside& aside : result.summary.asides) report.Tell(DescribeAside(aside));
  for (const std::string& warning : result.warnings) report.Warn(warning);
  if (!options.json.empty()) {
    WriteJsonFile(options.json, ReadJsonFile(std::filesystem::path(options.out) / "summary.json"));
  }
  return result;
}

}  // namespace cohort
