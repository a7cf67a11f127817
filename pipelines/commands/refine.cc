#include "pipelines/commands/refine.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "backend/colmap/model_io.h"
#include "datasets/open_sequence.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"
#include "pipelines/json/json_file.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/reconstruct.h"

namespace cohort {

void RunRefine(const RefineCommandOptions& options) {
  const TrackFile file = ReadTrackFile(options.tracks);
  const Reconstruction model = ReadModelFolder(options.model);
  if (model.points.empty()) {
    ThrowError("{}: the model has no points to look for: reconstruct first", options.model);
  }
  for (const auto& [feature, point] : model.points) {
    if (file.tracks.Track(feature).empty()) {
      ThrowError("{}: point {} is no track of {}: give the tracks that the model was made of",
                 options.model,
                 ToInt(feature),
                 options.tracks);
    }
  }
  const auto sequence = OpenSequence(options.images.empty() ? file.source : options.images);
  const auto mask = file.meta.find("mask");  // that the tracks were made with
  SecondPass second = MeasureAgain(file,
                                   model,
                                   *sequence,
                                   ReadMask(mask == file.meta.end() ? "" : mask->second),
                                   options.second_pass,
                                   ProgressBars());
  second.file.meta["refined_from"] = AbsolutePath(options.tracks);
  WriteTrackFile(options.out, second.file);

  const SecondPassFigures& figures = second.figures;
  if (figures.left > figures.replaced) {
    spdlog::warn("{}: the scene is not as the model has it", figures.Brief());
  }
  if (!options.json.empty()) {
    WriteJsonFile(options.json,
                  {{"observations_before", figures.before},
                   {"kept", figures.kept},
                   {"dropped", figures.before - figures.kept},
                   {"regained", figures.regained},
                   {"options", ToJson(options)}});
  }
  fmt::print("{}",
             AlignedTable({{"tracks", options.out},
                           {"observations before", fmt::format("{}", figures.before)},
                           {"measured again", fmt::format("{}", figures.kept)},
                           {"dropped", fmt::format("{}", figures.before - figures.kept)},
                           {"regained", fmt::format("{}", figures.regained)}}));
}

Command RefineCommand() {
  return MakeCommand({.name = "refine",
                      .usage = "F.tracks --model DIR --out G.tracks [options]",
                      .summary = "Measure tracks again where their reconstruction says they are",
                      .positionals = {"tracks"},
                      .required = {"tracks", "model", "out"}},
                     RunRefine);
}

}  // namespace cohort
