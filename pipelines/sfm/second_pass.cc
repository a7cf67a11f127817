#include "pipelines/sfm/second_pass.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <vector>

#include "backend/geometry/triangulation.h"
#include "backend/scene/mapper.h"
#include "pipelines/json/option_list.h"

namespace cohort {
namespace {

bool Observed(const Observation& o) { return o.state == ObservationState::kObserved; }

// Where the model's points are in every frame.
class ModelPredictions {
 public:
  ModelPredictions(const TrackFile& file,
                   const Reconstruction& model,
                   const cv::Mat& mask,
                   const SecondPassOptions& o)
      : file_(file), model_(model), mask_(mask), options_(o) {
    for (const auto& [feature, point] : model.points) {
      std::vector<FrameIndex> seen;
      for (const Observation& observation : file.tracks.Track(feature)) {
        if (Observed(observation) && model.cam_from_world.contains(observation.frame)) {
          seen.push_back(observation.frame);
        }
      }
      if (seen.empty()) continue;
      const auto middle = static_cast<std::ptrdiff_t>(seen.size() / 2);
      const auto half = static_cast<std::ptrdiff_t>(o.measurement.template_frames / 2);
      const auto count = static_cast<std::ptrdiff_t>(seen.size());
      const auto first = std::max<std::ptrdiff_t>(0, middle - half);
      const auto end = std::min(count, first + o.measurement.template_frames);
      for (auto i = first; i < end; ++i) template_features_[seen[i]].push_back(feature);
      middle_[feature] = seen[middle];
    }
  }

  std::vector<ModelPrediction> ForTemplates(FrameIndex frame) const {
    std::vector<ModelPrediction> predictions;
    const auto it = template_features_.find(frame);
    if (it == template_features_.end()) return predictions;
    for (const FeatureId feature : it->second) {
      const auto xy = Project(model_.points.at(feature).in_world, frame);
      const auto warp = Warp(feature, middle_.at(feature), frame);
      if (xy && warp) predictions.push_back({feature, *xy, *warp});
    }
    return predictions;
  }

  std::vector<ModelPrediction> InSight(FrameIndex frame) const {
    std::vector<ModelPrediction> predictions;
    if (!model_.cam_from_world.contains(frame)) return predictions;
    for (const auto& [feature, middle] : middle_) {
      const auto xy = InPicture(feature, frame);
      if (!xy) continue;
      const auto warp = Warp(feature, middle, frame);
      if (!warp) continue;
      const double scale = std::sqrt(warp->determinant());
      if (!(scale <= options_.max_scale && scale >= 1.0 / options_.max_scale)) continue;
      const Observation* observation = file_.tracks.Find(feature, frame);
      predictions.push_back(
          {feature, *xy, *warp, observation != nullptr && Observed(*observation)});
    }
    return predictions;
  }

  bool Predicts(FeatureId feature, FrameIndex frame) const {
    return middle_.contains(feature) && model_.cam_from_world.contains(frame);
  }

  // Where the model has the point, if that can be seen.
  std::optional<Eigen::Vector2d> InPicture(FeatureId feature, FrameIndex frame) const {
    const auto xy = Project(model_.points.at(feature).in_world, frame);
    if (!xy || !model_.camera.Contains(*xy, options_.border_px)) return std::nullopt;
    if (!mask_.empty()) {
      const auto x = static_cast<int>(std::lround(xy->x()));
      const auto y = static_cast<int>(std::lround(xy->y()));
      if (mask_.at<std::uint8_t>(y, x) == 0) return std::nullopt;
    }
    return xy;
  }

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
  const cv::Mat& mask_;
  const SecondPassOptions& options_;
  std::map<FeatureId, FrameIndex> middle_;  // whose view the template is
  std::map<FrameIndex, std::vector<FeatureId>> template_features_;
};

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

// What no image confirms, where the model has it: the frames between a feature's sightings, and
// those of the first pass. As uncertain as its sightings.
void AddPredictions(const TrackFile& file,
                    const ModelPredictions& predictions,
                    std::vector<Observation>& observations) {
  std::map<FeatureId, std::vector<Observation>> seen;
  for (const Observation& o : observations) seen[o.feature].push_back(o);
  for (const auto& [feature, sightings] : seen) {
    PixelCovariance mean{.xx = 0.0F, .xy = 0.0F, .yy = 0.0F};
    for (const Observation& o : sightings) {
      const auto count = static_cast<float>(sightings.size());
      mean.xx += o.covariance->xx / count;
      mean.xy += o.covariance->xy / count;
      mean.yy += o.covariance->yy / count;
    }
    auto sighting = sightings.begin();
    for (const FrameInfo& frame : file.frames) {
      if (sighting != sightings.end() && sighting->frame == frame.index) {
        ++sighting;
        continue;
      }
      const bool between = sighting != sightings.begin() && sighting != sightings.end();
      if (!predictions.Predicts(feature, frame.index) ||
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
std::vector<TrackEnd> EndsOf(const TrackFile& file, const std::vector<Observation>& observations) {
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
    if (!Observed(o) || pose == model.cam_from_world.end()) continue;
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
  const ModelPredictions predictions(file, model, mask, options);
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
    const bool was_observed = before != nullptr && Observed(*before);
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
      if (!predictions.Predicts(o.feature, o.frame)) {
        observations.push_back(o);
      } else if (Observed(o)) {
        ++second.figures.before;
      }
    }
  }
  std::vector<TrackEnd> ends = EndsOf(file, observations);
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
