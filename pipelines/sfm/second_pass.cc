#include "pipelines/sfm/second_pass.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "backend/mapper/mapper.h"
#include "backend/scene/near_world.h"
#include "frontend/core/statistics.h"
#include "frontend/image/exposure.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/for_each_frame.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/model_predictions.h"

namespace cohort {
namespace {

// The mean covariance of a feature whose sightings all have one.
PixelCovariance MeanCovariance(const std::vector<Observation>& sightings) {
  PixelCovariance mean{.xx = 0.0F, .xy = 0.0F, .yy = 0.0F};
  const auto count = static_cast<float>(sightings.size());
  for (const Observation& o : sightings) {
    mean.xx += o.covariance->xx / count;
    mean.xy += o.covariance->xy / count;
    mean.yy += o.covariance->yy / count;
  }
  return PixelCovariance::From(mean.Matrix());
}

// The features for which at least the share `min_confirmed` of those observations of the first pass
// that the model knows were measured again.
std::set<FeatureId> FoundAgain(const TrackFile& file,
                               const ModelPredictions& predictions,
                               const std::vector<Observation>& measured,
                               double min_confirmed,
                               SecondPassFigures& figures) {
  struct Count {
    std::size_t before = 0;
    std::size_t kept = 0;
    std::size_t regained = 0;
  };
  std::map<FeatureId, Count> counts;
  for (const Observation& o : file.tracks.observations()) {
    if (!predictions.Knows(o.feature, o.frame)) continue;
    Count& count = counts[o.feature];
    if (IsObserved(o) && !predictions.IsMasked(o)) ++count.before;
  }
  for (const Observation& o : measured) {
    const Observation* before = file.tracks.Find(o.feature, o.frame);
    const bool was_observed =
        before != nullptr && IsObserved(*before) && !predictions.IsMasked(*before);
    ++(was_observed ? counts[o.feature].kept : counts[o.feature].regained);
  }
  std::set<FeatureId> found;
  for (const auto& [feature, count] : counts) {
    if (count.before == 0 && count.regained == 0) {
      if (predictions.HasMask()) ++figures.masked;
      found.insert(feature);
      continue;
    }
    if (static_cast<double>(count.kept) < min_confirmed * static_cast<double>(count.before)) {
      ++figures.left;
      continue;
    }
    found.insert(feature);
    figures.Add(
        {.before = count.before, .kept = count.kept, .regained = count.regained, .replaced = 1});
  }
  return found;
}

// Adds the model's predictions where no image confirms a feature: in the frames between its
// sightings, and in those of the first pass. They are as uncertain as the mean of its sightings.
void AddPredictions(const TrackFile& file,
                    const ModelPredictions& predictions,
                    std::vector<Observation>& observations) {
  std::map<FeatureId, std::vector<Observation>> seen;
  for (const Observation& o : observations) seen[o.feature].push_back(o);
  for (const auto& [feature, sightings] : seen) {
    const PixelCovariance mean = MeanCovariance(sightings);
    auto sighting = sightings.begin();
    for (const FrameInfo& frame : file.frames) {
      if (sighting != sightings.end() && sighting->frame == frame.index) {
        ++sighting;
        continue;
      }
      const bool between = sighting != sightings.begin() && sighting != sightings.end();
      if (!predictions.Knows(feature, frame.index) ||
          (!between && file.tracks.Find(feature, frame.index) == nullptr)) {
        continue;
      }
      const auto xy = predictions.InPicture(feature, frame.index);
      if (!xy) continue;
      Observation& o = observations.emplace_back();
      o.feature = feature;
      o.frame = frame.index;
      o.xy = *xy;
      o.state = ObservationState::kPredicted;
      o.covariance = mean;
    }
  }
}

// The ends of the first pass, at the frames where the tracks end now; without tracks that reach the
// last frame.
std::vector<TrackEnd> EndsAfter(const TrackFile& file,
                                const std::vector<Observation>& observations) {
  std::map<FeatureId, FrameIndex> last;
  for (const Observation& o : observations) {
    const auto [it, first] = last.try_emplace(o.feature, o.frame);
    if (!first) it->second = std::max(it->second, o.frame);
  }
  std::vector<TrackEnd> ends;
  for (TrackEnd end : file.tracks.ends()) {
    const auto it = last.find(end.feature);
    if (it == last.end() || it->second == file.frames.back().index) continue;
    end.last_frame = it->second;
    ends.push_back(end);
  }
  return ends;
}

RowPoses RowsOf(const Reconstruction& model) {
  return {model.cam_from_world, model.readout, model.camera, model.frame_times};
}

// Distances between the positions of common points in common frames according to two models [px].
std::vector<double> DistancesBetween(const Reconstruction& before, const Reconstruction& now) {
  const RowPoses before_rows = RowsOf(before);
  const RowPoses now_rows = RowsOf(now);
  std::vector<double> distances_px;
  for (const auto& [feature, point] : now.points) {
    const auto old_point = before.points.find(feature);
    if (old_point == before.points.end()) continue;
    for (const auto& [frame, cam_from_world] : now.cam_from_world) {
      if (!before.cam_from_world.contains(frame)) continue;
      const auto xy = now_rows.Project(CameraOf(now, frame), frame, point.in_world);
      const auto old_xy =
          before_rows.Project(CameraOf(before, frame), frame, old_point->second.in_world);
      if (!xy || !old_xy || !now.camera.Contains(*xy)) continue;
      distances_px.push_back((*xy - *old_xy).norm());
    }
  }
  return distances_px;
}

// Whether an adjustment can show where the model of new tracks would be, instead of a
// reconstruction, which takes several times as long. This requires a complete model in which only
// poses and points move. (It does not hold if the tracker lost its features somewhere: across such
// a seam a model may have two scales, which no adjustment corrects.)
bool CanBeAdjusted(std::span<const Reconstruction> models, const TrackFile& file) {
  return models.size() == 1 && models.front().cam_from_world.size() == file.frames.size() &&
         models.front().readout == 0.0 && file.KnowsCamera();
}

// Notes the camera from which the next search starts, unless this search was undecided.
void NoteFoundCamera(const MapperResult& result, TrackFile& file) {
  const bool undecided = std::ranges::any_of(result.summary.reasons, [](const Doubt& doubt) {
    return doubt.code == DoubtCode::kTwoCameras;
  });
  if (!file.KnowsCamera() && !undecided) file.found_camera = result.reconstruction.camera;
}

// The light of every frame relative to the first one, estimated once for all rounds and parts.
struct LightsOfClip {
  Exposure exposure;
  std::map<FrameIndex, LightChange> of_frame;

  // Converts the frame to the light of the first one. In the first round, frames must come in
  // order.
  void TakeFrom(Frame& frame) {
    const auto [light, first_time] = of_frame.try_emplace(frame.index);
    if (first_time) light->second = exposure.Follow(frame.gray);
    frame = WithoutLight(std::move(frame), light->second);
  }
};

// The pictures in which features are measured.
struct Pictures {
  Sequence& sequence;
  LightsOfClip& lights;
};

// The tracks of the file, of which those that are found again where the model predicts them are
// replaced.
TrackSet MeasureWith(const TrackFile& file,
                     const Reconstruction& model,
                     const Pictures& pictures,
                     const SecondPassOptions& options,
                     const StageProgress& progress,
                     SecondPassFigures& figures) {
  ModelPredictions predictions(file, model, options.measurement.template_frames);
  SecondPassMeasurer measurer(options.measurement);
  ForEachFrame(file, pictures.sequence, "learn", progress, [&](Frame& frame) {
    pictures.lights.TakeFrom(frame);
    predictions.Mask(frame.index, frame.mask);
    measurer.Learn(frame, predictions.ForTemplates(frame.index));
  });
  ForEachFrame(file, pictures.sequence, "measure", progress, [&](Frame& frame) {
    if (!model.cam_from_world.contains(frame.index)) return;
    pictures.lights.TakeFrom(frame);
    measurer.Measure(frame, predictions.InSight(frame.index));
  });
  std::vector<Observation> observations = measurer.Finish();
  const std::set<FeatureId> replaced =
      FoundAgain(file, predictions, observations, options.min_confirmed, figures);
  std::erase_if(observations, [&](const auto& o) { return !replaced.contains(o.feature); });
  AddPredictions(file, predictions, observations);
  for (const Observation& o : file.tracks.observations()) {
    const bool stays = !replaced.contains(o.feature) || !predictions.Knows(o.feature, o.frame);
    if (stays && !predictions.IsInsideMask(o)) observations.push_back(o);
  }
  std::vector<TrackEnd> ends = EndsAfter(file, observations);
  return TrackSet::Build(std::move(observations), std::move(ends));
}

SecondPass MeasureInLight(const TrackFile& file,
                          std::span<const Reconstruction> models,
                          const Pictures& pictures,
                          const SecondPassOptions& options,
                          const StageProgress& progress) {
  SecondPass second{file, {}, {}};
  for (const Reconstruction& model : models) {
    second.file.tracks =
        MeasureWith(second.file, model, pictures, options, progress, second.figures);
  }
  second.file.meta.second_pass = true;
  second.file.meta.second_pass_options = SecondPassOptionsText(options);
  return second;
}

}  // namespace

double SecondPassFigures::Confirmed() const {
  return before == 0 ? 0.0 : static_cast<double>(kept) / static_cast<double>(before);
}

void SecondPassFigures::Add(const SecondPassFigures& other) {
  before += other.before;
  kept += other.kept;
  regained += other.regained;
  replaced += other.replaced;
  left += other.left;
  masked += other.masked;
}

std::string SecondPassFigures::Brief() const {
  return fmt::format(
      "{} tracks measured again, with {} of {} observations and {} more; {} tracks not found again "
      "are kept unchanged",
      replaced,
      kept,
      before,
      regained,
      left);
}

SecondPass MeasureAgain(const TrackFile& file,
                        const Reconstruction& model,
                        Sequence& sequence,
                        const SecondPassOptions& options,
                        const StageProgress& progress) {
  LightsOfClip lights;
  const NearModel near(model);
  return MeasureInLight(file, std::span(&near.get(), 1), {sequence, lights}, options, progress);
}

std::string SecondPassOptionsText(const SecondPassOptions& options) {
  SecondPassOptions copy = options;
  OptionLister lister;
  SecondPassOptions::VisitMeasurement(copy, lister);
  return OptionsToJson(lister.Take()).dump();
}

bool HaveMoved(std::span<const Reconstruction> models,
               const Reconstruction& now,
               const SecondPassOptions& options) {
  constexpr double kQuantile = 0.9;
  constexpr double kFar = 0.5;  // of the search distance of a feature
  constexpr double kManyNew = 0.05;
  const auto is_new = [&](const auto& pose) {
    return std::none_of(models.begin(), models.end(), [&](const Reconstruction& model) {
      return model.cam_from_world.contains(pose.first);
    });
  };
  const auto count = std::count_if(now.cam_from_world.begin(), now.cam_from_world.end(), is_new);
  if (static_cast<double>(count) > kManyNew * static_cast<double>(now.cam_from_world.size())) {
    return true;
  }
  std::vector<double> distances_px = DistancesBetween(models.front(), now);
  return distances_px.empty() || Quantile(std::move(distances_px), kQuantile) >
                                     kFar * options.measurement.patch.max_distance_px;
}

SecondPass WithSecondPass(TrackFile file,
                          Sequence& sequence,
                          const SecondPassOptions& options,
                          const StageProgress& progress) {
  // Bounds the time. If the model is far off at first, each round improves it.
  constexpr int kMostRounds = 3;
  // Of a part besides the largest, since each part takes as much time.
  constexpr std::size_t kLeastFrames = 10;
  LightsOfClip lights;
  SecondPass second{std::move(file), {}, {}};
  std::vector<Reconstruction> models;
  for (int round = 0; round < kMostRounds; ++round) {
    if (round > 0 && CanBeAdjusted(models, second.file) &&
        !HaveMoved(models, AdjustWithCeres(second.file, models.front()), options)) {
      break;
    }
    MapperResult result = ReconstructWithCeres(second.file, {.draft = true});
    if (result.summary.registered == 0) {
      if (round > 0) break;
      second.file.found_camera.reset();
      second.none_because = "the tracks do not reconstruct: " + result.summary.termination;
      second.file.meta.second_pass = false;
      second.file.meta.no_second_pass = second.none_because;
      break;
    }
    if (round > 0 && !HaveMoved(models, result.reconstruction, options)) break;
    NoteFoundCamera(result, second.file);
    models = std::move(result.other_parts);
    std::erase_if(models, [](const Reconstruction& part) {
      return part.cam_from_world.size() < kLeastFrames;
    });
    models.insert(models.begin(), std::move(result.reconstruction));
    second = MeasureInLight(second.file, models, {sequence, lights}, options, progress);
  }
  return second;
}

}  // namespace cohort
