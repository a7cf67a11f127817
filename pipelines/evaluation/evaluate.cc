#include "pipelines/evaluation/evaluate.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "backend/colmap/model_io.h"
#include "backend/colmap/model_tracks.h"
#include "datasets/open_sequence.h"
#include "datasets/truth/track_truth.h"
#include "frontend/core/time_difference.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/imported_tracks.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/evaluation/model_evaluation.h"
#include "pipelines/evaluation/track_error.h"
#include "pipelines/json/json_file.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/summary_json.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// null if a figure cannot be computed.
template <typename T>
Json OrNull(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

// edge_px: EvaluateOptions
TrackTruthOracle OracleOf(TrackTruth& truth, double edge_px) {
  return [&truth, edge_px](FrameIndex born, const Eigen::Vector2d& xy) -> std::optional<TruePath> {
    if (edge_px > 0.0 && truth.IsOnDepthEdge(born, xy, edge_px)) return std::nullopt;
    const auto anchor = truth.Pick(born, xy);
    if (!anchor) return std::nullopt;
    return [&truth, anchor = *anchor](FrameIndex frame) -> std::optional<TrueSighting> {
      const auto position = truth.Locate(anchor, frame);
      if (!position) return std::nullopt;
      return TrueSighting{position->xy, position->visible};
    };
  };
}

Json ErrorsToJson(const std::optional<ErrorSummary>& errors) {
  if (!errors) return nullptr;
  return {{"count", errors->count},
          {"median_px", errors->median_px},
          {"p90_px", errors->p90_px},
          {"mean_px", errors->mean_px}};
}

Json ErrorsToJson(const std::map<int, ErrorSummary>& errors_by_frames) {
  Json json = Json::object();
  for (const auto& [frames, errors] : errors_by_frames) {
    json[std::to_string(frames)] = ErrorsToJson(errors);
  }
  return json;
}

Json CalibrationToJson(const CalibrationFigure& figure) {
  Json tenths = Json::array();
  for (const CalibrationFigure::Tenth& tenth : figure.tenths) {
    tenths.push_back({{"claimed_px", tenth.claimed_px}, {"nees_ratio", tenth.nees_ratio}});
  }
  return {{"count", figure.count},
          {"nees_ratio", figure.nees_ratio},
          {"robust_sigma", figure.robust_sigma},
          {"share_beyond_3", figure.share_beyond_3},
          {"histogram_sigmas", CalibrationFigure::kHistogramSigmas},
          {"histogram", figure.histogram},
          {"tenths", tenths}};
}

// Throws Error if the clip ends before the last frame of `what`; `kind`: "tracks were made" or
// "model was made".
void CheckHasFrame(Sequence& sequence, FrameIndex last, const std::string& what, const char* kind) {
  const auto frames = sequence.FrameCount();
  if (!frames || ToInt(last) < *frames) return;
  ThrowError("{} has a frame {}, but {} has {} frames: give the clip that the {} from",
             what,
             ToInt(last),
             sequence.Name(),
             *frames,
             kind);
}

// Whether the times are counted: frames without their own times are a thirtieth of a second apart.
bool AreTimesCounted(std::span<const FrameInfo> frames) {
  return std::ranges::all_of(frames, [](const FrameInfo& frame) {
    constexpr std::uint64_t kSameNs = 1'000'000;
    const std::int64_t counted_ns = std::llround(ToInt(frame.index) * 1e9 / 30.0);
    return TimeBetween(frame.timestamp_ns, counted_ns) < kSameNs;
  });
}

// Frames are compared by number. If the numbers belong to other frames, as with every n-th frame of
// a clip or a selection of its pictures, names or times may reveal it. `of_subject`: ascending.
void WarnIfOtherFrames(std::span<const FrameInfo> of_subject,
                       const std::string& subject,
                       Sequence& sequence) {
  constexpr double kSameNs = 2e7;  // as for true poses
  if (of_subject.empty()) return;
  std::vector<FrameInfo> of_clip;
  while (const auto frame = sequence.Next()) {
    of_clip.push_back(InfoOf(*frame));
    if (frame->index >= of_subject.back().index) break;
  }
  sequence.Rewind();
  FrameNames names(of_clip);
  for (const FrameInfo& frame : of_subject) {
    const auto named = names.Find(frame.name);
    if (!named || *named == frame.index) continue;
    spdlog::warn(
        "frame {} of {} is called {}, which is the name of frame {} of {}: frames are compared by "
        "number, so give the truth of the same pictures",
        ToInt(frame.index),
        subject,
        frame.name,
        ToInt(*named),
        sequence.Name());
    return;
  }
  if (AreTimesCounted(of_subject)) return;
  std::map<FrameIndex, std::int64_t> times;
  for (const FrameInfo& frame : of_clip) times[frame.index] = frame.timestamp_ns;
  for (std::size_t i = 1; i < of_subject.size(); ++i) {
    const FrameInfo& a = of_subject[i - 1];
    const FrameInfo& b = of_subject[i];
    if (!times.contains(a.index) || !times.contains(b.index)) continue;
    const double in_subject = TimeFromTo(a.timestamp_ns, b.timestamp_ns);
    const double in_clip = TimeFromTo(times[a.index], times[b.index]);
    if (in_subject <= 0.0 || in_clip <= 0.0 || std::abs(in_subject - in_clip) <= kSameNs) continue;
    spdlog::warn(
        "frames {} and {} are {:.0f} ms apart in {}, but {:.0f} ms in {}: check that they are the "
        "same frames",
        ToInt(a.index),
        ToInt(b.index),
        1e-6 * in_subject,
        subject,
        1e-6 * in_clip,
        sequence.Name());
    return;
  }
}

// Throws Error if the tracks cannot belong to the clip.
void CheckIsClipOf(const TrackFile& file, const std::string& tracks, Sequence& sequence) {
  const auto picture = sequence.Next();
  sequence.Rewind();
  if (picture && (picture->gray.cols != file.width_px || picture->gray.rows != file.height_px)) {
    ThrowError(
        "{} was made from pictures of {}x{}, but those of {} have {}x{}: give the clip that the "
        "tracks were made from",
        tracks,
        file.width_px,
        file.height_px,
        sequence.Name(),
        picture->gray.cols,
        picture->gray.rows);
  }
  if (!file.frames.empty()) {
    CheckHasFrame(sequence, file.frames.back().index, tracks, "tracks were made");
  }
  WarnIfOtherFrames(file.frames, tracks, sequence);
}

Json EvaluateTrackFile(const std::string& path,
                       Sequence& sequence,
                       TrackTruth* truth,
                       double edge_px) {
  if (truth == nullptr) {
    ThrowError(
        "{} has no true tracks: this needs true poses and depth pictures, such as those of `cohort "
        "synth`",
        sequence.Name());
  }
  const TrackFile file = ReadTrackFile(path);
  CheckIsClipOf(file, path, sequence);
  ReinitializationOptions options;
  options.width_px = file.width_px;
  options.height_px = file.height_px;
  std::vector<FrameIndex> frames;
  for (const FrameInfo& frame : file.frames) frames.push_back(frame.index);
  const TrackEvaluation figures =
      EvaluateTracks(file.tracks, frames, OracleOf(*truth, edge_px), options);
  return {{"tracks", figures.tracks},
          {"tracks_without_truth", figures.tracks_without_truth},
          {"mean_track_length", file.tracks.MeanObservedLength()},
          {"observed", ErrorsToJson(figures.observed)},
          {"outlier_share", OrNull(figures.outlier_share)},
          {"calibration",
           figures.calibration ? CalibrationToJson(*figures.calibration) : Json(nullptr)},
          {"predicted", ErrorsToJson(figures.predicted)},
          {"hidden", ErrorsToJson(figures.hidden)},
          {"hidden_but_observed", ErrorsToJson(figures.hidden_but_observed)},
          {"predicted_precision", OrNull(figures.predicted_precision)},
          {"predicted_recall", OrNull(figures.predicted_recall)},
          {"mean_frames_between_reinitializations",
           OrNull(figures.reinitializations.mean_frames_between)},
          {"l1_error_30_frames_px",
           figures.trajectory_l1 ? Json(figures.trajectory_l1->mean_px) : Json(nullptr)}};
}

// The frames that have a true pose.
std::vector<FrameIndex> FramesOf(const ModelTruth& truth) {
  std::vector<FrameIndex> frames;
  for (const auto& [frame, pose] : truth.cam_from_world) frames.push_back(frame);
  return frames;
}

// The frames that a model should contain: those in summary.json or, for another program's model,
// all that have a true pose.
std::vector<FrameIndex> FramesOfModel(const fs::path& folder, const ModelTruth& truth) {
  const fs::path summary = folder / "summary.json";
  if (!fs::exists(summary)) return FramesOf(truth);
  std::optional<std::string> text;
  std::set<FrameIndex> repeats;  // have the poses of others
  std::vector<Aside> asides;
  UseJsonFile(summary, [&](const Json& json) {
    if (json.contains("repeats")) {
      for (const Json& pair : json.at("repeats")) {
        repeats.insert(FrameIndex{pair.at(0).get<std::uint32_t>()});
      }
    }
    asides = AsidesOf(json);  // nor are those that show something else missing
    if (json.contains("frame_range")) text = json.at("frame_range").get<std::string>();
  });
  if (!text) return FramesOf(truth);
  constexpr std::size_t kMostFrames = 10'000'000;
  FrameRange range;
  try {
    range = FrameRange::Parse(*text);
  } catch (const Error& error) {
    ThrowError("{}: {}", summary.string(), error.what());
  }
  const std::size_t count = range.Count(range.end.value_or(range.first));
  if (count > kMostFrames) {
    ThrowError("{}: frame_range '{}' has {} frames: up to {} are supported",
               summary.string(),
               *text,
               count,
               kMostFrames);
  }
  std::vector<FrameIndex> frames;
  for (std::size_t i = 0; i < count; ++i) {
    const FrameIndex frame{static_cast<std::uint32_t>(range.first + i * range.stride)};
    if (!repeats.contains(frame) && !AnyHas(asides, frame)) frames.push_back(frame);
  }
  return frames;
}

// Whether a model numbers its images by frame, as ours do. Models of other programs do not, nor do
// refinements of these.
bool IsNumberedByFrame(const fs::path& folder) {
  const fs::path summary = folder / "summary.json";
  return fs::exists(summary) && !ReadJsonFile(summary).contains("refined_from");
}

// The frames that a refined model should contain, by the clip's numbers: those that it has, and as
// many others as its summary states in addition, which count as missing.
std::vector<FrameIndex> FramesOfRefined(const Reconstruction& model, std::size_t count) {
  std::vector<FrameIndex> frames;
  for (const auto& [frame, pose] : model.cam_from_world) frames.push_back(frame);
  for (std::uint32_t i = 0; frames.size() < count; ++i) {
    if (!model.cam_from_world.contains(FrameIndex(i))) frames.push_back(FrameIndex(i));
  }
  return frames;
}

// The poses of another model under the frames of the first one: matched by name if the two share
// names, because other programs number images differently, else by number.
std::map<FrameIndex, Rigid3> PosesOfSameFrames(const Reconstruction& model,
                                               const Reconstruction& other) {
  std::vector<FrameInfo> frames;
  for (const auto& [frame, name] : model.frame_names) frames.push_back({frame, name, {}});
  FrameNames names(frames);
  std::map<FrameIndex, Rigid3> poses;
  for (const auto& [frame, name] : other.frame_names) {
    const auto pose = other.cam_from_world.find(frame);
    if (pose == other.cam_from_world.end()) continue;
    if (const auto named = names.Find(name)) poses[*named] = pose->second;
  }
  if (!poses.empty()) return poses;
  spdlog::warn("the two models share no image names: their images are matched by number");
  return other.cam_from_world;
}

bool IsModelFolder(const fs::path& folder) {
  return fs::exists(folder / "images.bin") || fs::exists(folder / "images.txt");
}

// The truth of a clip, or of another model, then in that model's unit of length.
ModelTruth TruthOfPoses(const Sequence& sequence, TrackTruth* truth) {
  ModelTruth model_truth;
  model_truth.cam_from_world = sequence.TrueCamFromWorld();
  if (model_truth.cam_from_world.empty()) {
    ThrowError(
        "{} has no true pose of any frame: give a clip in TUM RGB-D, EuRoC or KITTI layout, with "
        "poses at the times of its frames",
        sequence.Name());
  }
  if (truth != nullptr) {
    model_truth.point = [truth](FrameIndex frame,
                                const Eigen::Vector2d& xy) -> std::optional<Eigen::Vector3d> {
      const auto anchor = truth->Pick(frame, xy);
      if (!anchor) return std::nullopt;
      return anchor->x_in_world;
    };
  }
  return model_truth;
}

// A model under the frames of a clip: matched by the names of its images if they are names of
// frames, else by number.
Reconstruction ReadModelOf(const fs::path& folder, Sequence& sequence) {
  if (IsNumberedByFrame(folder)) {
    Reconstruction model = ReadReconstruction(folder);
    if (!model.cam_from_world.empty()) {
      CheckHasFrame(
          sequence, model.cam_from_world.rbegin()->first, folder.string(), "model was made");
    }
    std::vector<FrameInfo> frames;
    for (const auto& [frame, pose] : model.cam_from_world) {
      const auto name = model.frame_names.find(frame);
      const auto time = model.timestamps_ns.find(frame);
      if (name == model.frame_names.end() || time == model.timestamps_ns.end()) continue;
      frames.push_back({frame, name->second, time->second});
    }
    WarnIfOtherFrames(frames, folder.string(), sequence);
    const auto picture = sequence.Next();
    if (picture && (picture->gray.cols != model.camera.width_px ||
                    picture->gray.rows != model.camera.height_px)) {
      spdlog::warn(
          "{} was made from pictures of {}x{}, but those of {} have {}x{}: check that it belongs "
          "to this clip",
          folder.string(),
          model.camera.width_px,
          model.camera.height_px,
          sequence.Name(),
          picture->gray.cols,
          picture->gray.rows);
    }
    return model;
  }
  const std::vector<FrameInfo> frames = ReadFrames(sequence).frames;
  const ColmapModel model = ReadColmapModel(folder);
  FrameNames names(frames);
  const bool named = std::any_of(model.images.begin(), model.images.end(), [&](const auto& image) {
    return names.Find(image.second.name).has_value();
  });
  if (named) {
    ModelOfClip clip = ReadModelOfClip(model, frames, folder);
    if (clip.unknown_images > 0) {
      spdlog::warn(
          "{}: {} of its images are not frames of {} and are left out, such as {}: if that is the "
          "first or the last image, the names are numbers that are off by one",
          folder.string(),
          clip.unknown_images,
          sequence.Name(),
          clip.an_unknown_image);
    }
    return std::move(clip.reconstruction);
  }
  spdlog::warn(
      "no image of {} has the name of a frame of {}: they are matched by number, image 1 with "
      "frame 0",
      folder.string(),
      sequence.Name());
  return ReadReconstruction(folder);
}

Json EvaluateModelFolder(const Reconstruction& model,
                         const std::vector<FrameIndex>& frames,
                         const ModelTruth& truth) {
  const ModelEvaluation figures = EvaluateModel(model, frames, truth);
  ReconstructionSummary summary;
  summary.registered = figures.registered;
  summary.frames = figures.frames;
  summary.points = model.points.size();
  Json json{{"registered", figures.registered},
            {"frames", figures.frames},
            {"failed", summary.Failed()},
            {"ate_m", OrNull(figures.ate_m)},
            {"ate_share", OrNull(figures.ate_share)},
            {"rpe_rot_deg", OrNull(figures.rpe_rot_deg)},
            {"rpe_trans_m", OrNull(figures.rpe_trans_m)},
            {"point_error_median_m", OrNull(figures.point_error_median_m)},
            {"points_with_truth", figures.points_with_truth},
            {"auc_5", OrNull(figures.auc_5)},
            {"auc_10", OrNull(figures.auc_10)},
            {"auc_20", OrNull(figures.auc_20)},
            {"scale", OrNull(figures.scale)}};
  if (summary.Failed()) json["why_failed"] = summary.WhyFailed();
  if (!figures.ate_m) json["why_no_ate"] = Reason(figures.alignment);
  return json;
}

}  // namespace

Json Evaluate(const EvaluateOptions& options) {
  if (!fs::exists(options.subject)) {
    ThrowError("there is no .tracks file or model folder {}", options.subject);
  }
  CheckOutputsGiven({options.json});
  const bool is_model = fs::is_directory(options.subject);
  if (!is_model && IsModelFolder(options.truth)) {
    ThrowUsageError(
        "{} is a model, against which tracks cannot be evaluated: give a clip with truth",
        options.truth);
  }
  if (is_model && options.edge_px != EvaluateOptions().edge_px) {
    ThrowUsageError("--edge-px is for tracks: leave it out with the model {}", options.subject);
  }
  if (IsModelFolder(options.truth) && options.layout != Layout::kAuto) {
    ThrowUsageError("--layout is for a clip: leave it out with the model {}", options.truth);
  }
  Json figures;
  if (is_model && IsModelFolder(options.truth)) {
    const Reconstruction model = ReadReconstruction(options.subject);
    ModelTruth other;
    other.cam_from_world = PosesOfSameFrames(model, ReadReconstruction(options.truth));
    const std::vector<FrameIndex> frames = IsNumberedByFrame(options.subject)
                                               ? FramesOfModel(options.subject, other)
                                               : FramesOf(other);
    figures = EvaluateModelFolder(model, frames, other);
    // Lengths are in the other model's unit, which is not the metre.
    for (const char* key : {"ate_m", "rpe_trans_m", "auc_5", "auc_10", "auc_20"}) {
      figures[key] = nullptr;
    }
  } else {
    const auto sequence = OpenSequence(options.truth, options.layout);
    const auto truth = OpenTrackTruth(*sequence, options.truth);
    if (is_model) {
      const ModelTruth poses = TruthOfPoses(*sequence, truth.get());
      const Reconstruction model = ReadModelOf(options.subject, *sequence);
      std::vector<FrameIndex> frames = FramesOfModel(options.subject, poses);
      if (fs::exists(fs::path(options.subject) / "summary.json") &&
          !IsNumberedByFrame(options.subject)) {
        frames = FramesOfRefined(model, frames.size());
      }
      figures = EvaluateModelFolder(model, frames, poses);
      const auto without = std::ranges::count_if(
          model.cam_from_world,
          [&poses](const auto& camera) { return !poses.cam_from_world.contains(camera.first); });
      if (without > 0) {
        spdlog::warn(
            "{} has no true pose for {} of the {} cameras: the errors are those of the others",
            sequence->Name(),
            without,
            model.cam_from_world.size());
      }
    } else {
      figures = EvaluateTrackFile(options.subject, *sequence, truth.get(), options.edge_px);
    }
  }
  if (!options.json.empty()) WriteJsonFile(options.json, figures);
  return figures;
}

}  // namespace cohort
