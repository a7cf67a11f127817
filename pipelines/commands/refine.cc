#include "pipelines/commands/refine.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "backend/colmap/model_io.h"
#include "datasets/open_sequence.h"
#include "frontend/storage/input_record.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/command_line.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/doubts.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/kept_frames.h"
#include "pipelines/sfm/reconstruct.h"

namespace cohort {
namespace {

// These options have no effect on tracks, which a user who gives one would not expect.
void CheckNoneIsOfModels(const RefineModelOptions& options) {
  for (const std::string& path : ChangedOptions(options)) {
    ThrowUsageError("--{} is for a COLMAP model: leave it out with a .tracks file", FlagName(path));
  }
}

void RefineTracks(const RefineCommandOptions& options) {
  CheckNoneIsOfModels(options.of_model);
  CheckDistinctOutputs({{"--out", options.out}, {"--json", options.json}});
  const TrackFile file = ReadTrackFile(options.tracks);
  const Reconstruction model = ReadModelFolder(options.model);
  // The new tracks may replace the old ones if the same name is given.
  if (CanonicalPath(options.out) == CanonicalPath(options.tracks)) InputRecord::Forget(options.out);
  CheckOutputsGiven({options.out, options.json});
  if (model.points.empty()) {
    ThrowError("{}: the model has no points to measure: reconstruct first", options.model);
  }
  const JobReport report = ConsoleReport();
  report.Warn(DoubtOfModel(model, options.model, file, options.tracks));
  const std::string mask = options.mask.empty() ? file.meta.mask : options.mask;
  MaskedSequence sequence(KeepFrames(options.images.empty() ? OpenSource(file, options.tracks)
                                                            : OpenSequence(options.images)),
                          ClipMasks(mask),
                          !options.images.empty() || file.meta.frames.empty(),
                          FixedPartsOf(file));
  if (options.images.empty()) report.Warn(DoubtOfClip(file, options.tracks, sequence));
  if (options.mask.empty()) report.Warn(DoubtOfMask(file, options.tracks));
  SecondPass second =
      MeasureAgain(file, model, sequence, options.of_model.second_pass, ProgressBars());
  if (second.figures.replaced + second.figures.left == 0 && second.figures.masked > 0) {
    ThrowError(
        "the mask {} covers all {} tracks that have a point: give a mask that is white at these "
        "points",
        mask,
        second.figures.masked);
  }
  second.file.meta.refined_from = AbsolutePath(options.tracks);
  NoteMask(mask, second.file);
  WriteTrackFile(options.out, second.file);

  const SecondPassFigures& figures = second.figures;
  report.Warn(DoubtOfMeasuring(figures));
  if (!options.json.empty()) {
    WriteJsonFile(options.json,
                  {{"observations_before", figures.before},
                   {"kept", figures.kept},
                   {"dropped", figures.before - figures.kept},
                   {"regained", figures.regained},
                   {"masked_tracks", figures.masked},
                   {"options", ToJson(options)}});
  }
  fmt::print("{}",
             AlignedTable({{"tracks", options.out},
                           {"observations before", fmt::format("{}", figures.before)},
                           {"measured again", fmt::format("{}", figures.kept)},
                           {"dropped", fmt::format("{}", figures.before - figures.kept)},
                           {"regained", fmt::format("{}", figures.regained)},
                           {"tracks that the mask covers", fmt::format("{}", figures.masked)}}));
}

void RefineColmapModel(const RefineCommandOptions& options) {
  if (options.of_model.second_pass.measurement.patch.max_distance_px !=
      SecondPassOptions().measurement.patch.max_distance_px) {
    ThrowUsageError(
        "--max-distance-px is for a .tracks file: for a COLMAP model, use --model-max-distance-px");
  }
  if (options.images.empty()) {
    ThrowUsageError(
        "refining a COLMAP model needs its pictures: give --images INPUT, or the .tracks file that "
        "the model was made from");
  }
  MaskedSequence sequence(KeepFrames(OpenSequence(options.images)), ClipMasks(options.mask));
  AddModelToInputs(options.model);
  CheckOutputsGiven({options.json});
  const RefinedModel refined = RefineModelIntoFolder(options.model,
                                                     sequence,
                                                     options.images,
                                                     options.mask,
                                                     options.of_model,
                                                     options.out,
                                                     ProgressBars());
  for (const std::string& note : refined.notes) spdlog::warn("{}", note);
  for (const std::string& warning : refined.adjusted.warnings) spdlog::warn("{}", warning);
  const ReconstructionSummary& summary = refined.adjusted.summary;
  for (const Doubt& reason : summary.reasons) spdlog::warn("{}", reason.sentence);
  if (!options.json.empty()) {
    WriteJsonFile(options.json, ReadJsonFile(std::filesystem::path(options.out) / "summary.json"));
  }
  fmt::print(
      "{}",
      AlignedTable(
          {{"model", options.out},
           {"frames", fmt::format("{}", summary.registered)},
           {"points before", fmt::format("{}", refined.before.points)},
           {"points", fmt::format("{}", summary.points)},
           {"measured again", fmt::format("{}", refined.found.replaced)},
           {"dropped: masked", fmt::format("{}", refined.found.masked)},
           {"dropped: contradicted by the pictures", fmt::format("{}", refined.contradicted)},
           {"observations before", fmt::format("{}", refined.before.observations)},
           {"observations", fmt::format("{}", summary.observations)},
           {"mean reprojection error before [px]",
            fmt::format("{:.3f}", refined.before.mean_reprojection_px)},
           {"mean reprojection error [px]", fmt::format("{:.3f}", summary.mean_reprojection_px)}}));
}

}  // namespace

void RunRefine(const RefineCommandOptions& options) {
  if (options.tracks.empty()) {
    RefineColmapModel(options);
  } else {
    RefineTracks(options);
  }
}

Command RefineCommand() {
  return MakeCommand(
      {.name = "refine",
       .usage = "F.tracks --model DIR --out G.tracks [options], or cohort refine --model "
                "COLMAP_MODEL --images INPUT --out DIR [options]",
       .summary = "Measure tracks, or a COLMAP model, again where the model predicts them",
       .positionals = {"tracks"},
       .required = {"model", "out"}},
      RunRefine);
}

}  // namespace cohort
