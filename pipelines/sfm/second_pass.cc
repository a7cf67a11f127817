#include "pipelines/sfm/second_pass.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <vector>

#include "backend/geometry/triangulation.h"
#include "backend/scene/mapper.h"
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

std::string SecondPassFigures::Brief() const {
  return fmt::format(
      "{} of {} observations measured again, {} regained, {} tracks dropped that move otherwise",
      kept,
      before,
      regained,
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
  ForEachFrame(file, sequence, "learn", progress, [&](const Frame& frame) {
    measurer.Learn(frame, predictions.ForTemplates(frame.index));
  });
  ForEachFrame(file, sequence, "measure", progress, [&](const Frame& frame) {
    measurer.Measure(frame, predictions.InSight(frame.index));
  });

  SecondPass second{file, {}, {}};
  std::vector<Observation> observations = measurer.Finish();
  for (const Observation& o : observations) {
    const Observation* before = file.tracks.Find(o.feature, o.frame);
    const bool was_observed = before != nullptr && IsObserved(*before);
    ++(was_observed ? second.figures.kept : second.figures.regained);
  }
  AddPredictions(file, predictions, observations);
  for (const FeatureId feature : file.tracks.features()) {
    const auto track = file.tracks.Track(feature);
    if (options.drop_movers && !model.points.contains(feature) &&
        MovesOtherwise(track, model, options.measurement.patch.max_distance_px)) {
      ++second.figures.movers;
      continue;
    }
    for (const Observation& o : track) {
      if (!predictions.Knows(o.feature, o.frame)) {
        observations.push_back(o);
      } else if (IsObserved(o)) {
        ++second.figures.before;
      }
    }
  }
  std::vector<TrackEnd> ends = EndsAfter(file, observations);
  second.file.tracks = TrackSet::Build(std::move(observations), std::move(ends));
  second.file.meta["second_pass"] = "done";
  second.file.meta["second_pass_options"] = ToJson(options).dump();
  return second;
}

SecondPass WithSecondPass(TrackFile file,
                          Sequence& sequence,
                          const cv::Mat& mask,
                          const SecondPassOptions& options,
                          const StageProgress& progress) {
  const MapperResult model = ReconstructWithCeres(file, {});
  const auto without = [&file](const std::string& reason, const SecondPassFigures& figures) {
    file.meta["second_pass"] = "none: " + reason;
    return SecondPass{std::move(file), figures, reason};
  };
  if (model.summary.Failed()) {
    return without("the tracks do not reconstruct: " + model.summary.Brief(), {});
  }
  SecondPass second = MeasureAgain(file, model.reconstruction, sequence, mask, options, progress);
  if (second.figures.Confirmed() < options.min_confirmed) {
    return without(
        fmt::format("only {}: the scene is not as the model has it", second.figures.Brief()),
        second.figures);
  }
  return second;
}

}  // namespace cohort
