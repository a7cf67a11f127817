#include "backend/scene/reconstruction.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "backend/scene/phrasebook.h"
#include "backend/scene/row_poses.h"
#include "frontend/core/statistics.h"

namespace cohort {

namespace {

// Calls `use` with every point, each of its views, and the view's distance from the point's
// projection.
template <typename Model, typename Use>
void ForEachError(Model& reconstruction, const Use& use) {
  const RowPoses rows(reconstruction);
  for (auto& [feature, point] : reconstruction.points) {
    for (const PointView& view : point.views) {
      const Rigid3 cam_from_world = reconstruction.readout == 0.0
                                        ? reconstruction.cam_from_world.at(view.frame)
                                        : rows.CamFromWorld(view.frame, view.xy);
      const Camera camera = CameraOf(reconstruction, view.frame);
      const auto xy = camera.Project(cam_from_world * point.in_world);
      // A point behind the camera has no projection; its error counts as the picture's width.
      use(point, view, xy ? (*xy - view.xy).norm() : camera.width_px);
    }
  }
}

}  // namespace

Camera CameraOf(const Reconstruction& reconstruction, FrameIndex frame) {
  return CameraOf(reconstruction.camera, reconstruction.focal_scale, frame);
}

FocalLengths FocalLengthsOf(const Reconstruction& reconstruction) {
  std::optional<FocalLengths> lengths;
  for (const auto& [frame, pose] : reconstruction.cam_from_world) {
    const double fx = CameraOf(reconstruction, frame).fx;
    if (!lengths) lengths = {fx, fx};
    lengths->min_px = std::min(lengths->min_px, fx);
    lengths->max_px = std::max(lengths->max_px, fx);
  }
  return lengths.value_or(FocalLengths{reconstruction.camera.fx, reconstruction.camera.fx});
}

void UpdateReprojectionErrors(Reconstruction& reconstruction) {
  for (auto& [feature, point] : reconstruction.points) point.mean_reprojection_px = 0.0;
  ForEachError(reconstruction, [](Point3D& point, const PointView&, double error_px) {
    point.mean_reprojection_px += error_px;
  });
  for (auto& [feature, point] : reconstruction.points) {
    if (!point.views.empty()) point.mean_reprojection_px /= static_cast<double>(point.views.size());
  }
}

void MoveViewsToTracks(const TrackSet& tracks, double readout, Reconstruction& reconstruction) {
  reconstruction.readout = readout;
  for (auto& [feature, point] : reconstruction.points) {
    for (PointView& view : point.views) {
      if (const Observation* o = tracks.Find(feature, view.frame)) view.xy = o->xy;
    }
  }
  UpdateReprojectionErrors(reconstruction);
}

std::map<FrameIndex, std::vector<double>> ReprojectionErrors(const Reconstruction& reconstruction) {
  std::map<FrameIndex, std::vector<double>> errors;
  ForEachError(reconstruction, [&](const Point3D&, const PointView& view, double error_px) {
    errors[view.frame].push_back(error_px);
  });
  return errors;
}

double MedianDistance(const Reconstruction& reconstruction) {
  std::vector<double> distances;
  for (const auto& [feature, point] : reconstruction.points) {
    for (const PointView& view : point.views) {
      distances.push_back((reconstruction.cam_from_world.at(view.frame) * point.in_world).norm());
    }
  }
  return Median(std::move(distances));
}

std::vector<std::string> SentencesOf(const std::vector<Doubt>& doubts) {
  std::vector<std::string> sentences;
  for (const Doubt& doubt : doubts) sentences.push_back(doubt.sentence);
  return sentences;
}

void NoteFrames(const TrackFile& file, Reconstruction& reconstruction) {
  for (const FrameInfo& frame : file.frames) {
    if (!reconstruction.cam_from_world.contains(frame.index)) continue;
    reconstruction.timestamps_ns[frame.index] = frame.timestamp_ns;
  }
  reconstruction.frame_times = CaptureTimes(file);
  reconstruction.repeats.clear();
  for (const RepeatedFrame& repeat : file.repeats) {
    if (reconstruction.cam_from_world.contains(repeat.original)) {
      reconstruction.repeats.push_back(repeat);
    }
  }
}

bool AnyHas(const std::vector<Aside>& asides, FrameIndex frame) {
  return std::ranges::any_of(asides, [frame](const Aside& aside) { return aside.Has(frame); });
}

ReconstructionSummary Summarize(const Reconstruction& reconstruction,
                                std::size_t frames,
                                std::size_t aside) {
  ReconstructionSummary summary;
  summary.registered = reconstruction.cam_from_world.size() + reconstruction.repeats.size();
  summary.frames = frames;
  summary.aside_frames = aside;
  summary.points = reconstruction.points.size();
  double error_sum = 0.0;
  for (const auto& [feature, point] : reconstruction.points) {
    summary.observations += point.views.size();
    error_sum += point.mean_reprojection_px * static_cast<double>(point.views.size());
  }
  if (summary.points > 0) {
    summary.mean_track_length =
        static_cast<double>(summary.observations) / static_cast<double>(summary.points);
  }
  if (summary.observations > 0) {
    summary.mean_reprojection_px = error_sum / static_cast<double>(summary.observations);
  }
  if (summary.registered > 0 && TooFewRegistered(summary.registered, summary.SceneFrames())) {
    summary.reasons.push_back(FewFramesDoubt(summary.registered, summary.SceneFrames()));
  }
  return summary;
}

ModelQuality ReconstructionSummary::Quality() const {
  if (registered == 0) return ModelQuality::kFailed;
  return reasons.empty() ? ModelQuality::kGood : ModelQuality::kDoubtful;
}

std::string ReconstructionSummary::WhyFailed() const {
  if (!TooFewRegistered(registered, SceneFrames())) return "the model has no points";
  return fmt::format("{} of {} frames have a pose, fewer than 80 %", registered, SceneFrames());
}

std::string ReconstructionSummary::Brief() const {
  return fmt::format(
      "{} of {} frames registered, {} points, {} observations, mean track length {:.1f}, mean "
      "reprojection error {:.2f} px, {:.1f} s: {}",
      registered,
      frames,
      points,
      observations,
      mean_track_length,
      mean_reprojection_px,
      seconds,
      termination);
}

}  // namespace cohort
