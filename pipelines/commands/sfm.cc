#include "pipelines/commands/sfm.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "backend/colmap/program.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/storage/output.h"
#include "frontend/storage/write_lock.h"
#include "pipelines/console/messages.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/report/clip_report.h"
#include "pipelines/sfm/cuts.h"
#include "pipelines/sfm/doubts.h"
#include "pipelines/sfm/film_advice.h"
#include "pipelines/sfm/fingerprint.h"
#include "pipelines/sfm/summary_json.h"
#include "pipelines/sfm/version.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct SfmFigures {
  ReconstructionSummary model;
  std::size_t images = 0;
  std::size_t points = 0;                // of the scene
  std::size_t points_added = 0;          // of these, to the points of the tracks
  std::optional<double> expected_error;  // of the cameras, share of the extent of their path
  std::optional<double> focal_px;        // of a camera that was not known
  std::optional<double> focal_sigma_px;
  std::vector<Stretch> other_parts;      // of the clip, that have their own models
  std::vector<std::string> notes;        // on the frames that do not show the scene
  std::vector<std::string> film_better;  // FilmAdvice
};

// Everything on which the scene depends, in the form that summary.json keeps: the program, the
// options, and a fingerprint of the input's files.
Json SceneMadeOf(SfmOptions options, const Sequence& sequence) {
  options.resume = false;
  options.json.clear();
  options.track.threads = 0;
  options.out.clear();
  const std::string input = std::exchange(options.track.input.input, "");
  Json made_of{{"program", fmt::format("cohort {}", kVersion)},
               {"input", CanonicalPath(input)},
               {"fingerprint", FingerprintOfFrames(sequence)},
               {"options", ToJson(options)}};
  if (const std::string& mask = options.track.masks.mask; !mask.empty()) {
    made_of["mask_fingerprint"] = FingerprintOfMasks(mask);
  }
  if (const auto camera = sequence.KnownCamera()) made_of["calibration"] = WordsOfCamera(*camera);
  // In the form in which it is read again, also with names that are not UTF-8.
  return Json::parse(JsonLine(made_of));
}

// The same for the model, which does not depend on the scene's options. clip.tracks records what
// the tracks were made from, and HasTracksOf compares it.
Json ModelMadeOf(Json made_of) {
  const Json of_scene = ToJson(SceneOptions{});
  for (const auto& [name, value] : of_scene.items()) made_of["options"].erase(name);
  return made_of;
}

using Fingerprints = std::map<std::string, std::string>;

// As a list of pairs, because there may be one per frame, and a JSON object with that many keys
// would be rejected when it is read (frontend/core/json_text.h).
Json PairsOf(const Fingerprints& files) {
  Json pairs = Json::array();
  for (const auto& [file, fingerprint] : files) pairs.push_back(Json::array({file, fingerprint}));
  return pairs;
}
Fingerprints FilesIn(const Json& json) {
  Fingerprints files;
  for (const Json& pair : json) files.emplace(pair.at(0), pair.at(1));
  return files;
}

// `stamp`, a file in the scene folder, records what its `files` were made from, and their
// fingerprints.
bool IsStillThere(const fs::path& folder, const char* stamp, const Json& made_of) {
  if (!fs::exists(folder / stamp)) return false;
  try {
    const Json json = ReadJsonFile(folder / stamp);
    return json.at("made_of") == made_of && AreStillThere(folder, FilesIn(json.at("files")));
  } catch (const Json::exception&) {  // written by another version
    return false;
  } catch (const Error&) {  // damaged
    return false;
  }
}

constexpr const char* kModelStamp = "model_of.json";

bool HasModelOf(const fs::path& folder, const Json& made_of) {
  try {
    ReadJsonFile(folder / "model" / "summary.json");
  } catch (const Error&) {  // missing or damaged
    return false;
  }
  return IsStillThere(folder, kModelStamp, made_of);
}

// The fingerprints of the tracks and of everything made from them, except the model's summary,
// which contains a time.
Fingerprints FilesOfModel(const fs::path& folder) {
  Fingerprints files = FingerprintsOfOutputs(folder, {"clip.tracks", "model"});
  files.erase("model/summary.json");
  return files;
}

// Makes the model of the tracks, unless it already belongs to them. Returns its summary.json.
fs::path MakeSceneModel(const SfmOptions& options, const Json& made_of) {
  ReconstructFileOptions model = options.model;
  model.tracks = (fs::path(options.out) / "clip.tracks").string();
  model.out = (fs::path(options.out) / "model").string();
  if (options.resume && HasModelOf(options.out, made_of)) {
    spdlog::info("{} is already complete", model.out);
  } else {
    const fs::path stamp = fs::path(options.out) / kModelStamp;
    std::error_code ignored;
    fs::remove(stamp, ignored);
    ReconstructFile(model, ConsoleReport());
    WriteJsonFile(stamp, {{"made_of", made_of}, {"files", PairsOf(FilesOfModel(options.out))}});
  }
  return fs::path(model.out) / "summary.json";
}

template <typename T>
std::optional<T> Find(const Json& json, const char* key) {
  const auto it = json.find(key);
  if (it == json.end() || it->is_null()) return std::nullopt;
  return it->get<T>();
}

// Those of the model, whether it was made now or kept.
SfmFigures FiguresOf(const fs::path& summary) {
  SfmFigures figures;
  UseJsonFile(summary, [&figures](const Json& model) {
    figures.model.registered = CountAt(model, "registered");
    figures.model.frames = CountAt(model, "frames");
    figures.model.aside_frames =
        figures.model.frames - std::min(figures.model.frames, CountAt(model, "scene_frames"));
    figures.model.asides = AsidesOf(model);
    figures.model.points = CountAt(model, "points");
    figures.model.observations = CountAt(model, "observations");
    figures.model.mean_track_length = model.at("mean_track_length").get<double>();
    figures.model.mean_reprojection_px = model.at("mean_reprojection_px").get<double>();
    figures.model.seconds = model.at("seconds").get<double>();
    figures.model.termination = model.at("termination").get<std::string>();
    figures.model.reasons = DoubtsFromJson(model.at("reasons"));
    figures.expected_error = Find<double>(model, "expected_error");
    if (model.contains("camera") && model["camera"].contains("sigma")) {
      figures.focal_px = Find<double>(model["camera"], "fx");
      figures.focal_sigma_px = Find<double>(model["camera"]["sigma"], "fx");
    }
    for (const Json& part : model.value("other_parts", Json::array())) {
      figures.other_parts.push_back({FrameIndex{part.at("first_frame").get<std::uint32_t>()},
                                     FrameIndex{part.at("last_frame").get<std::uint32_t>()}});
    }
  });
  return figures;
}

Json ClipToJson(const ClipMeasures& clip) {
  const auto or_null = [](const std::optional<double>& value) {
    return value ? Json(*value) : Json();
  };
  return {{"observed", clip.observed},
          {"parallax_deg", or_null(clip.parallax_deg)},
          {"moving_share", or_null(clip.moving_share)},
          {"brightness", {clip.dark, clip.brightness, clip.bright}}};
}

Json SummaryOf(const SfmFigures& figures,
               const std::vector<FrameIndex>& cuts,
               const ClipMeasures& clip,
               const Json& made_of,
               const Fingerprints& files) {
  Json json{{"registered", figures.model.registered},
            {"frames", figures.model.frames},
            {"scene_frames", figures.model.SceneFrames()},
            {"images", figures.images},
            {"points", figures.points},
            {"points_added", figures.points_added},
            {"failed", figures.model.Failed()},
            {"termination", figures.model.termination},
            {"quality", std::string(NameOf(kModelQualityNames, figures.model.Quality()))},
            {"reasons", DoubtsToJson(figures.model.reasons)},
            {"expected_error", figures.expected_error ? Json(*figures.expected_error) : Json()},
            {"cuts", NumbersOf(cuts)},
            {"notes", figures.notes},
            {"film_better", figures.film_better},
            {"clip", ClipToJson(clip)},
            {"made_of", made_of},
            {"files", PairsOf(files)}};
  return json;
}

// Those of a scene that is complete.
SfmFigures FiguresOfScene(const fs::path& folder) {
  SfmFigures figures = FiguresOf(folder / "model" / "summary.json");
  UseJsonFile(folder / "summary.json", [&figures](const Json& summary) {
    figures.images = CountAt(summary, "images");
    figures.points = CountAt(summary, "points");
    figures.notes = summary.at("notes").get<std::vector<std::string>>();
    figures.points_added = CountAt(summary, "points_added");
    figures.film_better = summary.at("film_better").get<std::vector<std::string>>();
  });
  return figures;
}

// Writes everything in the scene folder but its page. `made_of`, `model_made_of`: SceneMadeOf,
// ModelMadeOf.
SfmFigures MakeScene(const SfmOptions& options,
                     Sequence& sequence,
                     const Json& made_of,
                     const Json& model_made_of) {
  const fs::path folder = options.out;
  TrackClipOptions track = options.track;
  track.out = (folder / "clip.tracks").string();
  if (options.resume && HasTracksOf(track, ConsoleReport())) {
    spdlog::info("{} is already complete", track.out);
  } else {
    TrackClip(track, ConsoleReport());
  }
  std::error_code ignored;
  for (const char* old : {"summary.json", "report.html"}) fs::remove(folder / old, ignored);
  const TrackFile file = ReadTrackFile(track.out);
  SfmFigures figures = FiguresOf(MakeSceneModel(options, model_made_of));
  std::vector<double> brightness;
  Fingerprints files;
  Reconstruction model;
  if (figures.model.registered > 0) {
    model = ReadModelFolder(folder / "model");
    const SceneFigures scene =
        WriteScene(file, model, sequence, options.scene, folder, ProgressBars());
    figures.images = scene.images.size();
    figures.points = scene.points;
    figures.points_added = scene.points_added;
    brightness = scene.brightness;
    std::vector<std::string> outputs(kSceneOutputs.begin(), kSceneOutputs.end());
    std::erase_if(outputs, [&folder](const auto& name) { return !fs::exists(folder / name); });
    files = FingerprintsOfOutputs(folder, outputs);
  } else {
    RemoveScene(folder);  // a scene of an earlier run would not belong to these tracks
    brightness = BrightnessOfFrames(file, sequence, ProgressBars());
  }
  const FilmedClip clip{
      .file = file,
      .model = model,
      .termination = figures.model.termination,
      .brightness = brightness,
      .features_wanted = static_cast<std::size_t>(track.tracker.detector.max_features),
      .other_parts = figures.other_parts,
      .asides = figures.model.asides};
  const ClipMeasures measures = MeasureClip(clip);
  figures.notes = DescribeAsides(clip);
  figures.film_better = FilmAdvice(clip, measures);
  WriteJsonFile(folder / "summary.json",
                SummaryOf(figures, file.meta.cuts, measures, made_of, files));
  ConsoleReport().Warn(DoubtOfClip(file, "clip.tracks", sequence));
  return figures;
}

void PrintFigures(const SfmFigures& figures, const std::string& out) {
  std::vector<std::vector<std::string>> rows{
      {"scene", out},
      {"frames with a pose",
       fmt::format("{} of {}", figures.model.registered, figures.model.SceneFrames())},
      {"pictures of the scene", fmt::format("{}", figures.images)},
      {"points of the scene",
       figures.points_added == 0 ? fmt::format("{}", figures.points)
                                 : fmt::format("{}, of which {} of the tracks and {} added",
                                               figures.points,
                                               figures.points - figures.points_added,
                                               figures.points_added)}};
  rows.push_back({"quality", std::string(NameOf(kModelQualityNames, figures.model.Quality()))});
  if (figures.expected_error) {
    rows.push_back(
        {"expected error of the cameras",
         fmt::format("{:.2g} % of the extent of their path", 100.0 * *figures.expected_error)});
  }
  if (figures.focal_px && figures.focal_sigma_px) {
    rows.push_back({"focal length found",
                    fmt::format("{:.0f} +- {:.0f} px",
                                *figures.focal_px,
                                std::max(1.0, std::ceil(*figures.focal_sigma_px)))});
  }
  rows.push_back({"report", (fs::path(out) / "report.html").string()});
  fmt::print("{}", AlignedTable(rows));
  for (const std::string& note : figures.notes) PrintLine("Left out: {}", note);
  for (const Doubt& reason : figures.model.reasons) PrintLine("Doubt: {}", reason.sentence);
  for (const std::string& advice : figures.film_better) PrintLine("To film better: {}", advice);
}

// Writes SCENE/report.html, unless it already belongs to this scene.
void WriteSceneReport(const SfmOptions& options, const SfmFigures& figures) {
  const fs::path folder = options.out;
  const fs::path page = folder / "report.html";
  if (fs::exists(page)) return;  // MakeScene has removed any other scene's
  ClipReport report = ReadClipReport(folder / "model");
  report.sentences.insert(report.sentences.end(), figures.notes.begin(), figures.notes.end());
  report.sentences.insert(
      report.sentences.end(), figures.film_better.begin(), figures.film_better.end());
  const auto sequence = OpenInput(options.track.input);
  report.title = sequence->Name();
  WriteClipReport(page, report, ReadTrackFile(folder / "clip.tracks"), *sequence, ProgressBars());
}

}  // namespace

void RunSfm(const SfmOptions& options) {
  const fs::path folder = options.out;
  CheckOutputsGiven({options.json});
  const auto sequence = OpenInput(options.track.input, options.track.masks);
  const Json made_of = SceneMadeOf(options, *sequence);
  const Json model_made_of = ModelMadeOf(made_of);
  const ReconstructOptions& reconstruct = options.model.reconstruct;
  if (reconstruct.backend == BackendKind::kColmap &&
      !(options.resume && HasModelOf(folder, model_made_of))) {
    RequireColmap(reconstruct.colmap.program, reconstruct.colmap.max_minutes);
  }
  // Checks before hours of work that the folder can be created.
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) ThrowError("cannot make folder {}: {}", options.out, error.message());
  const WriteLock lock = WriteLock::Of(folder);
  SfmFigures figures;
  if (options.resume && IsStillThere(folder, "summary.json", made_of) &&
      HasModelOf(folder, model_made_of)) {
    ConsoleReport().Warn(WarningOfKept(ReadTrackFile(folder / "clip.tracks")));
    spdlog::info("{} is already complete", options.out);
    figures = FiguresOfScene(folder);
  } else {
    CheckSceneFolder(folder);
    figures = MakeScene(options, *sequence, made_of, model_made_of);
  }
  if (!options.json.empty()) WriteJsonFile(options.json, ReadJsonFile(folder / "summary.json"));
  WriteSceneReport(options, figures);
  PrintFigures(figures, options.out);
  if (figures.model.Failed()) {
    ThrowError("the reconstruction failed: {} ({}); see the advice on filming above and in {}",
               figures.model.WhyFailed(),
               figures.model.termination,
               (folder / "report.html").string());
  }
}

Command SfmCommand() {
  return MakeCommand(
      {.name = "sfm",
       .usage = "INPUT --out SCENE [options]",
       .summary = "From a video to a scene: tracks, cameras, points, undistorted pictures",
       .positionals = {"input"},
       .required = {"input", "out"},
       .short_flags = {{"features", {"track.detector.max_features"}},
                       {"second-pass", {"second_pass.mode"}},
                       {"backend", {"model.backend"}},
                       {"colmap-program", {"model.colmap.program"}}}},
      RunSfm);
}

}  // namespace cohort
