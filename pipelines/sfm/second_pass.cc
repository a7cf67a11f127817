#include "pipelines/sfm/second_pass.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>
#include <vector>

#include "backend/geometry/triangulation.h"
#include "backend/scene/mapper.h"
#include "frontend/core/statistics.h"
#include "frontend/image/exposure.h"
#include "frontend/track/companion_tracker.h"
#include "frontend/tracks/companions.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/model_predictions.h"

namespace cohort {
namespace {

// Calls `use` with every frame of the tracks.
template <typename Use>
void ForEachFrame(const TrackFile& file,
                  Sequence& sequence,
                  std::string_view stage,
                  const StageProgress& progress,
                  const Use& use) {
  sequence.Rewind();
  std::size_t done = 0;
  if (progress) progress(stage, done, file.frames.size());
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
    if (progress) progress(stage, ++done, file.frames.size());
  }
}

// Of a feature whose every sighting has one.
PixelCovariance MeanCovariance(const std::vector<Observation>& sightings) {
  PixelCovariance mean{.xx = 0.0F, .xy = 0.0F, .yy = 0.0F};
  const auto count = static_cast<float>(sightings.size());
  for (const Observation& o : sightings) {
    mean.xx += o.covariance->xx / count;
    mean.xy += o.covariance->xy / count;
    mean.yy += o.covariance->yy / count;
  }
  return mean;
}

// The features of which at least `min_confirmed` of the first pass's observations were measured
// again, where the model knows them.
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
    if (IsObserved(o) && !predictions.IsMasked(o.xy)) ++count.before;
  }
  for (const Observation& o : measured) {
    const Observation* before = file.tracks.Find(o.feature, o.frame);
    const bool was_observed = before != nullptr && IsObserved(*before);
    ++(was_observed ? counts[o.feature].kept : counts[o.feature].regained);
  }
  std::set<FeatureId> found;
  for (const auto& [feature, count] : counts) {
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

// What no image confirms, where the model has it: the frames between a feature's sightings, and
// those of the first pass. As uncertain as the mean of its sightings.
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

// The first pass's, at the frame where the track ends now; not of tracks that reach the last frame.
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

// Does the new model have many points elsewhere in the pictures, so far that features were looked for
// in wrong places?
bool HaveMoved(const Reconstruction& before,
               const Reconstruction& now,
               const SecondPassOptions& options) {
  constexpr double kQuantile = 0.9;
  constexpr double kFar = 0.5;  // of how far a feature is looked for
  std::vector<double> distances_px;
  for (const auto& [feature, point] : now.points) {
    const auto old_point = before.points.find(feature);
    if (old_point == before.points.end()) continue;
    for (const auto& [frame, cam_from_world] : now.cam_from_world) {
      const auto old_pose = before.cam_from_world.find(frame);
      if (old_pose == before.cam_from_world.end()) continue;
      const auto xy = now.camera.Project(cam_from_world * point.in_world);
      const auto old_xy = before.camera.Project(old_pose->second * old_point->second.in_world);
      if (!xy || !old_xy || !now.camera.Contains(*xy)) continue;
      distances_px.push_back((*xy - *old_xy).norm());
    }
  }
  return Quantile(std::move(distances_px), kQuantile) >
         kFar * options.measurement.patch.max_distance_px;
}

}  // namespace

bool MovesOtherwise(std::span<const Observation> track,
                    const Reconstruction& model,
                    double max_error_px) {
  constexpr std::size_t kLeastRays = 10;
  std::vector<Ray> rays;
  for (const Observation& o : track) {
    const auto pose = model.cam_from_world.find(o.frame);
    if (!IsObserved(o) || pose == model.cam_from_world.end()) continue;
    rays.push_back({pose->second, model.camera.Unproject(o.xy)});
  }
  if (rays.size() < kLeastRays) return false;
  const double max_error = max_error_px / model.camera.fx;
  const std::size_t half = rays.size() / 2;
  if (TriangulateRobustly(rays, max_error, half)) return false;
  const Ray& middle = rays[half];
  constexpr double kInfinitelyFar = 1e6;
  const Eigen::Vector3d far_point =
      middle.cam_from_world.Inverse() * (kInfinitelyFar * middle.n.homogeneous()).eval();
  const auto explained = std::count_if(rays.begin(), rays.end(), [&](const Ray& ray) {
    const auto error = RayError(ray, far_point);
    return error && *error <= max_error;
  });
  return static_cast<std::size_t>(explained) < half;
}

double SecondPassFigures::Confirmed() const {
  return before == 0 ? 0.0 : static_cast<double>(kept) / static_cast<double>(before);
}

void SecondPassFigures::Add(const SecondPassFigures& other) {
  before += other.before;
  kept += other.kept;
  regained += other.regained;
  replaced += other.replaced;
  left += other.left;
  movers += other.movers;
}

std::string SecondPassFigures::Brief() const {
  return fmt::format(
      "{} tracks measured again, with {} of {} observations and {} more; {} tracks not found again "
      "stay as they were, {} that move otherwise are dropped",
      replaced,
      kept,
      before,
      regained,
      left,
      movers);
}

SecondPass MeasureAgain(const TrackFile& file,
                        const Reconstruction& model,
                        Sequence& sequence,
                        const cv::Mat& mask,
                        const SecondPassOptions& options,
                        const StageProgress& progress) {
  const ModelPredictions predictions(file, model, mask, options.measurement.template_frames);
  SecondPassMeasurer measurer(options.measurement);
  Exposure exposure;
  std::map<FrameIndex, LightChange> lights;
  ForEachFrame(file, sequence, "learn", progress, [&](Frame& frame) {
    const LightChange& light = lights[frame.index] = exposure.Follow(frame.gray);
    frame.gray = WithoutLight(frame.gray, light);
    measurer.Learn(frame, predictions.ForTemplates(frame.index));
  });
  ForEachFrame(file, sequence, "measure", progress, [&](Frame& frame) {
    frame.gray = WithoutLight(frame.gray, lights.at(frame.index));
    measurer.Measure(frame, predictions.InSight(frame.index));
  });

  SecondPass second{file, {}, {}};
  std::vector<Observation> observations = measurer.Finish();
  const std::set<FeatureId> replaced =
      FoundAgain(file, predictions, observations, options.min_confirmed, second.figures);
  std::erase_if(observations, [&](const auto& o) { return !replaced.contains(o.feature); });
  AddPredictions(file, predictions, observations);
  for (const FeatureId feature : file.tracks.features()) {
    const auto track = file.tracks.Track(feature);
    if (options.drop_movers && !model.points.contains(feature) &&
        MovesOtherwise(track, model, options.measurement.patch.max_distance_px)) {
      ++second.figures.movers;
      continue;
    }
    for (const Observation& o : track) {
      if (!replaced.contains(feature) || !predictions.Knows(feature, o.frame)) {
        observations.push_back(o);
      }
    }
  }
  std::vector<TrackEnd> ends = EndsAfter(file, observations);
  second.file.tracks = TrackSet::Build(std::move(observations), std::move(ends));
  second.file.meta["second_pass"] = "done";
  second.file.meta["second_pass_options"] = SecondPassOptionsText(options);
  return second;
}

std::string SecondPassOptionsText(const SecondPassOptions& options) {
  SecondPassOptions copy = options;
  OptionLister lister;
  SecondPassOptions::VisitMeasurement(copy, lister);
  return OptionsToJson(lister.Take()).dump();
}

SecondPass WithSecondPass(TrackFile file,
                          Sequence& sequence,
                          const cv::Mat& mask,
                          const SecondPassOptions& options,
                          const StageProgress& progress) {
  // Two pixels: of what is nearer the patches are nearly the same.
  constexpr double kTwinsWithinPx = 2.0;
  // A bound on time: where the model is far off at first, each round brings it nearer.
  constexpr int kMostRounds = 3;
  std::optional<FeatureId> first_companion;
  if (file.meta.contains("companion")) {
    CompanionTracks both =
        JoinCompanions({std::move(file.tracks), kFirstCompanion}, kTwinsWithinPx);
    file.tracks = std::move(both.tracks);
    first_companion = both.first_companion;
  }
  SecondPass second{std::move(file), {}, {}};
  std::vector<Reconstruction> models;
  for (int round = 0; round < kMostRounds; ++round) {
    MapperResult result = ReconstructWithCeres(second.file, {});
    if (result.summary.registered == 0) {
      if (round > 0) break;
      second.none_because = "the tracks do not reconstruct: " + result.summary.termination;
      second.file.meta["second_pass"] = "none: " + second.none_because;
      break;
    }
    if (round > 0 && !HaveMoved(models.front(), result.reconstruction, options)) break;
    models = std::move(result.other_parts);
    models.insert(models.begin(), std::move(result.reconstruction));
    second.figures = {};
    for (const Reconstruction& model : models) {
      SecondPass next = MeasureAgain(second.file, model, sequence, mask, options, progress);
      next.figures.Add(second.figures);
      second = std::move(next);
    }
    if (first_companion) {
      // What has been measured at the same place has become one.
      second.file.tracks =
          DropTwins({std::move(second.file.tracks), *first_companion}, kTwinsWithinPx);
    }
  }
  return second;
}

}  // namespace cohort
