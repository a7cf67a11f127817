#include "backend/grow/growth.h"

#include <algorithm>
#include <optional>
#include <set>

namespace cohort {
namespace {

// Frames gained between global bundle adjustments: their number grows with the logarithm of the
// clip's length. COLMAP's is 1.1, for photographs. Tuned on the tuning clips.
constexpr double kGlobalGrowth = 1.3;

bool RegisterFromNeighbour(WorkingModel& model, int frame) {
  const std::vector<int> nearest = model.NearestRegistered(frame, 1);
  return model.RegisterFrame(
      frame, nearest.empty() ? std::nullopt : std::optional(model.Pose(nearest.front())));
}

std::vector<int> TracksInFrame(const WhitenedTracks& whitened, int frame) {
  std::vector<int> tracks;
  for (const int o : whitened.ObservationsIn(frame)) {
    tracks.push_back(whitened.observations()[o].track);
  }
  return tracks;
}

// The one that sees most points. None: none sees any, has no pose and was not refused.
std::optional<int> FrameWithMostPoints(const WorkingModel& model,
                                       const std::vector<int>& candidates,
                                       const std::set<int>& refused) {
  std::optional<int> best;
  int most = 0;
  for (const int f : candidates) {
    if (model.HasPose(f) || refused.contains(f)) continue;
    const int points = model.CountVisiblePoints(f);
    if (points > most) {
      most = points;
      best = f;
    }
  }
  return best;
}

// None: there is none left to try.
std::optional<int> NextFrame(const WorkingModel& model,
                             const std::vector<int>& keyframes,
                             const std::set<int>& refused) {
  if (const auto keyframe = FrameWithMostPoints(model, keyframes, refused)) return keyframe;
  // Beside the model, only where keyframes are still missing on that side.
  std::vector<int> beside;
  for (const int k : keyframes) {
    if (model.HasPose(k)) continue;
    const int nearest = model.NearestRegistered(k, 1).front();
    const int step = k > nearest ? 1 : -1;
    if (nearest + step != k) beside.push_back(nearest + step);
  }
  return FrameWithMostPoints(model, beside, refused);
}

}  // namespace

void GrowModel(WorkingModel& model, const std::vector<int>& keyframes) {
  AdjustAll(model);
  double adjusted_at = model.registered();
  std::set<int> refused;
  while (const std::optional<int> frame = NextFrame(model, keyframes, refused)) {
    if (!RegisterFromNeighbour(model, *frame)) {
      refused.insert(*frame);
      continue;
    }
    refused.clear();
    const std::vector<int> tracks = TracksInFrame(model.whitened(), *frame);
    model.UpdateInliersNear(*frame, kInfinity);
    model.TriangulateTracks(tracks);
    AdjustAround(model, *frame);
    model.UpdateInliersNear(*frame, kInfinity);
    if (model.registered() >= kGlobalGrowth * adjusted_at) {
      AdjustAll(model);
      adjusted_at = model.registered();
    }
  }
  AdjustUntilSettled(model, 4, 5);
}

void RegisterOtherFrames(WorkingModel& model) {
  const std::vector<int> registered = model.RegisteredFrames();
  for (int f = registered.front() + 1; f < model.whitened().frame_count(); ++f) {
    if (!model.HasPose(f)) RegisterFromNeighbour(model, f);
  }
  for (int f = registered.front() - 1; f >= 0; --f) RegisterFromNeighbour(model, f);
  model.TriangulateAllTracks();
}

}  // namespace cohort
