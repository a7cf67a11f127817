#include "pipelines/commands/refine.h"

#include <Eigen/LU>
#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "backend/colmap/model_io.h"
#include "datasets/sequence.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/json_file.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// Where the model's points are in every frame, as guides for the second look.
class ModelGuides {
 public:
  ModelGuides(const TrackFile& file, const Reconstruction& model, const RefineCommandOptions& o)
      : file_(file), model_(model), options_(o) {
    for (const auto& [feature, point] : model.points) {
      std::vector<FrameIndex> seen;
      for (const Observation& observation : file.tracks.Track(feature)) {
        if (Observed(observation) && model.cam_from_world.contains(observation.frame)) {
          seen.push_back(observation.frame);
        }
      }
      if (seen.empty()) continue;
      const auto middle = static_cast<std::ptrdiff_t>(seen.size() / 2);
      const auto half = static_cast<std::ptrdiff_t>(o.second_look.template_frames / 2);
      const auto count = static_cast<std::ptrdiff_t>(seen.size());
      const auto first = std::max<std::ptrdiff_t>(0, middle - half);
      const auto end = std::min(count, first + o.second_look.template_frames);
      for (auto i = first; i < end; ++i) template_features_[seen[i]].push_back(feature);
      middle_[feature] = seen[middle];
    }
  }

  std::vector<Guide> ForTemplates(FrameIndex frame) const {
    std::vector<Guide> guides;
    const auto it = template_features_.find(frame);
    if (it == template_features_.end()) return guides;
    for (const FeatureId feature : it->second) {
      if (const auto xy = Project(model_.points.at(feature).in_world, frame)) {
        guides.push_back({feature, *xy});
      }
    }
    return guides;
  }

  std::vector<Guide> InSight(FrameIndex frame) const {
    std::vector<Guide> guides;
    if (!model_.cam_from_world.contains(frame)) return guides;
    for (const auto& [feature, middle] : middle_) {
      const auto xy = Project(model_.points.at(feature).in_world, frame);
      if (!xy || !model_.camera.Contains(*xy, options_.border_px)) continue;
      const auto warp = Warp(feature, middle, frame);
      if (!warp) continue;
      const double scale = std::sqrt(warp->determinant());
      if (!(scale <= options_.max_scale && scale >= 1.0 / options_.max_scale)) continue;
      const Observation* observation = file_.tracks.Find(feature, frame);
      guides.push_back({feature, *xy, *warp, observation != nullptr && Observed(*observation)});
    }
    return guides;
  }

  bool Guides(FeatureId feature, FrameIndex frame) const {
    return middle_.contains(feature) && model_.cam_from_world.contains(frame);
  }

  static bool Observed(const Observation& o) { return o.state == ObservationState::kObserved; }

 private:
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& in_world, FrameIndex frame) const {
    return model_.camera.Project(model_.cam_from_world.at(frame) * in_world);
  }

  // Derivative of the picture in `frame` by that in `from`, for a patch that faces `from`'s camera.
  std::optional<Eigen::Matrix2d> Warp(FeatureId feature, FrameIndex from, FrameIndex frame) const {
    const Rigid3& cam_from_world = model_.cam_from_world.at(from);
    const Eigen::Vector3d x = cam_from_world * model_.points.at(feature).in_world;
    const auto xy = model_.camera.Project(x);
    if (!xy) return std::nullopt;
    constexpr double kStepPx = 4.0;
    Eigen::Matrix2d warp;
    for (int axis = 0; axis < 2; ++axis) {
      std::array<Eigen::Vector2d, 2> ends;
      for (int side = 0; side < 2; ++side) {
        Eigen::Vector2d beside = *xy;
        beside[axis] += side == 0 ? -kStepPx : kStepPx;
        const Eigen::Vector3d on_patch = x.z() * model_.camera.Unproject(beside).homogeneous();
        const auto end = Project(cam_from_world.Inverse() * on_patch, frame);
        if (!end) return std::nullopt;
        ends[side] = *end;
      }
      warp.col(axis) = (ends[1] - ends[0]) / (2.0 * kStepPx);
    }
    if (!(warp.determinant() > 0.0)) return std::nullopt;
    return warp;
  }

  const TrackFile& file_;
  const Reconstruction& model_;
  const RefineCommandOptions& options_;
  std::map<FeatureId, FrameIndex> middle_;  // whose view the template is
  std::map<FrameIndex, std::vector<FeatureId>> template_features_;
};

// Calls `use` with every frame of the tracks.
template <typename Use>
void ForEachFrame(const TrackFile& file, Sequence& sequence, const char* what, const Use& use) {
  sequence.Rewind();
  ProgressBar progress(what, file.frames.size());
  std::optional<Frame> frame = sequence.Next();
  for (const FrameInfo& wanted : file.frames) {
    while (frame && frame->index < wanted.index) frame = sequence.Next();
    if (!frame || frame->index != wanted.index) {
      ThrowError(
          "{}: has no frame {} ({}), which the tracks are of: give the same clip by --images",
          sequence.Name(),
          ToInt(wanted.index),
          wanted.name);
    }
    if (frame->gray.cols != file.width_px || frame->gray.rows != file.height_px) {
      ThrowError(
          "{}: frames of {} x {} px, but the tracks are of {} x {}: give the same clip by "
          "--images",
          sequence.Name(),
          frame->gray.cols,
          frame->gray.rows,
          file.width_px,
          file.height_px);
    }
    use(*frame);
    progress.Advance();
  }
}

}  // namespace

RefineFigures RefineTracks(const RefineCommandOptions& options) {
  TrackFile file = ReadTrackFile(options.tracks);
  const Reconstruction model = ReadReconstruction(options.model);
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
  const ModelGuides guides(file, model, options);
  const auto sequence = OpenSequence(options.images.empty() ? file.source : options.images);
  SecondLook look(options.second_look);
  ForEachFrame(file, *sequence, "learn", [&](const Frame& frame) {
    look.Learn(frame, guides.ForTemplates(frame.index));
  });
  ForEachFrame(file, *sequence, "measure", [&](const Frame& frame) {
    look.Measure(frame, guides.InSight(frame.index));
  });

  RefineFigures figures;
  std::vector<Observation> observations = look.Finish();
  for (const Observation& o : observations) {
    const Observation* before = file.tracks.Find(o.feature, o.frame);
    const bool was_observed = before != nullptr && ModelGuides::Observed(*before);
    ++(was_observed ? figures.kept : figures.regained);
  }
  for (const Observation& o : file.tracks.observations()) {
    if (guides.Guides(o.feature, o.frame)) {
      if (ModelGuides::Observed(o)) ++figures.before;
    } else {
      observations.push_back(o);
    }
  }
  file.tracks = TrackSet::Build(std::move(observations));
  file.meta["refined_from"] = fs::absolute(options.tracks).lexically_normal().string();
  file.meta["refine_options"] = ToJson(options.second_look).dump();
  WriteTrackFile(options.out, file);
  return figures;
}

void RunRefine(const RefineCommandOptions& options) {
  const RefineFigures figures = RefineTracks(options);
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
