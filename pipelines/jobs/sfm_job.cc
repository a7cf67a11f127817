#include "pipelines/jobs/sfm_job.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "backend/colmap/program.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/storage/output.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/version.h"
#include "pipelines/jobs/track_doubts.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/cuts.h"
#include "pipelines/sfm/fingerprint.h"
#include "pipelines/sfm/summary_json.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr std::size_t kMostFramesWithCovariances = 600;  // memory grows with their square

TrackJobOptions TrackOptionsOf(const SfmJobOptions& options) {
  TrackJobOptions track;
  track.input = options.input;
  track.out = (fs::path(options.out) / "clip.tracks").string();
  track.masks = options.masks;
  track.threads = options.threads;
  track.tracker = options.tracker;
  track.second_pass = options.second_pass;
  return track;
}

// Everything on which the scene depends, in the form that summary.json keeps: the program, the
// options, and a fingerprint of the input's files.
Json SceneMadeOf(SfmJobOptions options, const Sequence& sequence) {
  options.resume = false;
  options.json.clear();
  options.threads = 0;
  options.out.clear();
  const std::string input = std::exchange(options.input.input, "");
  Json made_of{{"program", fmt::format("cohort {}", kVersion)},
               {"input", CanonicalPath(input)},
               {"fingerprint", FingerprintOfFrames(sequence)},
               {"options", ToJson(options)}};
  if (const std::string& mask = options.masks.mask; !mask.empty()) {
    made_of["mask_fingerprint"] = FingerprintOfMasks(mask);
  }
  if (const auto camera = sequence.KnownCamera()) made_of["calibration"] = WordsOfCamera(*camera);
  // In the form in which it is read again, also with names that are not UTF-8.
  return Json::parse(JsonLine(made_of));
}

// The same for the model, which does not depend on the scene's options. clip.tracks records what
// the tracks were made from, and HasTracksOfJob compares it.
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

bool HasModel(const fs::path& folder, const Json& made_of) {
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
fs::path MakeModel(const SfmJobOptions& options, std::size_t frames, const Json& made_of) {
  ReconstructJobOptions job;
  job.tracks = (fs::path(options.out) / "clip.tracks").string();
  job.out = (fs::path(options.out) / "model").string();
  job.reconstruct = options.reconstruct;
  if (frames > kMostFramesWithCovariances && job.reconstruct.ceres.covariances) {
    job.reconstruct.ceres.covariances = false;
    spdlog::info("more than {} frames: the covariances of cameras and points are not estimated",
                 kMostFramesWithCovariances);
  }
  if (options.resume && HasModel(options.out, made_of)) {
    spdlog::info("{} is already complete", job.out);
  } else {
    const fs::path stamp = fs::path(options.out) / kModelStamp;
    std::error_code ignored;
    fs::remove(stamp, ignored);
    RunReconstructJob(job);
    WriteJsonFile(stamp, {{"made_of", made_of}, {"files", PairsOf(FilesOfModel(options.out))}});
  }
  return fs::path(job.out) / "summary.json";
}

template <typename T>
std::optional<T> Find(const Json& json, const char* key) {
  const auto it = json.find(key);
  if (it == json.end() || it->is_null()) return std::nullopt;
  return it->get<T>();
}

// The frames of the models of other parts of the clip.
std::vector<Stretch> OtherPartsOf(const fs::path& summary) {
  std::vector<Stretch> parts;
  UseJsonFile(summary, [&parts](const Json& model) {
    if (!model.contains("other_parts")) return;
    for (const Json& part : model.at("other_parts")) {
      parts.push_back({FrameIndex{part.at("first_frame").get<std::uint32_t>()},
                       FrameIndex{part.at("last_frame").get<std::uint32_t>()}});
    }
  });
  return parts;
}

SfmFigures FiguresOf(const fs::path& summary) {
  SfmFigures figures;
  UseJsonFile(summary, [&figures](const Json& model) {
    figures.model.registered = CountAt(model, "registered");
    figures.model.frames = CountAt(model, "frames");
    if (model.contains("scene_frames")) {
      figures.model.aside_frames =
          figures.model.frames - std::min(figures.model.frames, CountAt(model, "scene_frames"));
    }
    figures.model.asides = AsidesOf(model);
    figures.model.points = CountAt(model, "points");
    figures.model.observations = CountAt(model, "observations");
    figures.model.mean_track_length = model.at("mean_track_length").get<double>();
    figures.model.mean_reprojection_px = model.at("mean_reprojection_px").get<double>();
    figures.model.seconds = model.at("seconds").get<double>();
    figures.model.termination = model.at("termination").get<std::string>();
    figures.quality = Find<std::string>(model, "quality").value_or("");
    if (model.contains("reasons")) figures.reasons = DoubtsFromJson(model.at("reasons"));
    figures.camera_uncertainty = Find<double>(model, "camera_uncertainty");
    figures.expected_error = Find<double>(model, "expected_error");
    if (model.contains("camera") && model["camera"].contains("sigma")) {
      figures.focal_px = Find<double>(model["camera"], "fx");
      figures.focal_sigma_px = Find<double>(model["camera"]["sigma"], "fx");
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
            {"quality", figures.quality.empty() ? Json() : Json(figures.quality)},
            {"reasons", DoubtsToJson(figures.reasons)},
            {"expected_error", figures.expected_error ? Json(*figures.expected_error) : Json()},
            {"camera_uncertainty",
             figures.camera_uncertainty ? Json(*figures.camera_uncertainty) : Json()},
            {"cuts", NumbersOf(cuts)},
            {"notes", figures.notes},
            {"film_better", figures.film_better},
            {"clip", ClipToJson(clip)},
            {"made_of", made_of},
            {"files", PairsOf(files)}};
  return json;
}

SfmFigures FiguresOfSummary(const fs::path& folder) {
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

// To --json, if it is given.
void WriteFigures(const SfmJobOptions& options, const fs::path& summary) {
  if (!options.json.empty()) WriteJsonFile(options.json, ReadJsonFile(summary));
}

}  // namespace

SfmFigures RunSfmJob(const SfmJobOptions& options) {
  const fs::path folder = options.out;
  const fs::path summary = folder / "summary.json";
  CheckOutputsGiven({options.json});
  const auto sequence = OpenInput(options.input, options.masks);
  const Json made_of = SceneMadeOf(options, *sequence);
  const Json model_made_of = ModelMadeOf(made_of);
  if (options.reconstruct.backend == BackendKind::kColmap &&
      !(options.resume && HasModel(folder, model_made_of))) {
    RequireColmap(options.reconstruct.colmap.program, options.reconstruct.colmap.max_minutes);
  }
  // Checks before hours of work that the folder can be created.
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) ThrowError("cannot make folder {}: {}", options.out, error.message());
  WriteLock lock = WriteLock::Of(folder);
  if (options.resume && IsStillThere(folder, "summary.json", made_of) &&
      HasModel(folder, model_made_of)) {
    WarnAgain(ReadTrackFile(folder / "clip.tracks"));
    spdlog::info("{} is already complete", options.out);
    SfmFigures figures = FiguresOfSummary(folder);
    WriteFigures(options, summary);
    figures.lock = std::move(lock);
    return figures;
  }
  CheckSceneFolder(folder);

  const TrackJobOptions track = TrackOptionsOf(options);
  if (options.resume && HasTracksOfJob(track)) {
    spdlog::info("{} is already complete", track.out);
  } else {
    RunTrackJob(track);
  }
  for (const fs::path& old : {summary, folder / "report.html"}) fs::remove(old, error);
  const TrackFile file = ReadTrackFile(folder / "clip.tracks");
  SfmFigures figures = FiguresOf(MakeModel(options, file.frames.size(), model_made_of));
  std::vector<double> brightness;
  Fingerprints files;
  Reconstruction model;
  if (figures.model.registered > 0) {
    model = ReadModelFolder(folder / "model");
    const SceneFigures scene =
        WriteScene(file, model, *sequence, options.scene, folder, ProgressBars());
    figures.images = scene.images.size();
    figures.points = scene.points;
    figures.points_added = scene.points_added;
    brightness = scene.brightness;
    std::vector<std::string> outputs(kSceneOutputs.begin(), kSceneOutputs.end());
    std::erase_if(outputs, [&folder](const auto& name) { return !fs::exists(folder / name); });
    files = FingerprintsOfOutputs(folder, outputs);
  } else {
    RemoveScene(folder);  // a scene of an earlier run would not belong to these tracks
    brightness = BrightnessOfFrames(file, *sequence, ProgressBars());
  }
  const FilmedClip clip{
      .file = file,
      .model = model,
      .termination = figures.model.termination,
      .brightness = brightness,
      .features_wanted = static_cast<std::size_t>(options.tracker.detector.max_features),
      .other_parts = OtherPartsOf(folder / "model" / "summary.json"),
      .asides = figures.model.asides};
  const ClipMeasures measures = MeasureClip(clip);
  figures.notes = DescribeAsides(clip);
  figures.film_better = FilmAdvice(clip, measures);
  WriteJsonFile(summary, SummaryOf(figures, file.meta.cuts, measures, made_of, files));
  WriteFigures(options, summary);
  WarnIfClipChanged(file, "clip.tracks", *sequence);
  figures.lock = std::move(lock);
  return figures;
}

}  // namespace cohort
