#include "backend/grow/parts.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "backend/grow/growth.h"
#include "backend/judge/judgement.h"
#include "backend/scene/phrasebook.h"
#include "backend/start/start.h"

namespace cohort {
namespace {

constexpr std::size_t kMaxParts = 20;  // a bound on time: a clip in more pieces is no clip

PartResult MapBody(const WhitenedTracks& whitened,
                   const Camera& camera,
                   const std::vector<int>& keyframes) {
  const std::vector<FramePairMotion> pairs = RankPairs(whitened, camera, keyframes);
  if (pairs.empty()) {
    return {NothingSharedEnd(kMinCommonTracks)};
  }
  // Whether it has parallax is judged by the model, if there is one: the noise of fast, shaken
  // cameras is hard to tell.
  Start start = FindStart(whitened, camera, pairs);
  if (start.model) {
    GrowModel(start.model->model, keyframes);
    return {{}, std::move(start.model->model)};
  }
  return {ExplainMissingModel(whitened, camera, keyframes, NoStartEnd(start.windows_tried))};
}

// The tracks that the model explains in less than half of its frames that see them.
std::vector<int> UnexplainedTracks(const WorkingModel& model) {
  const WhitenedTracks& whitened = model.whitened();
  std::vector<int> tracks;
  for (int track = 0; track < whitened.track_count(); ++track) {
    const auto [first, last] = whitened.TrackRange(track);
    int seen = 0;
    int explained = 0;
    for (int o = first; o < last; ++o) {
      if (!model.HasPose(whitened.observations()[o].frame)) continue;
      ++seen;
      if (model.IsInlier(o)) ++explained;
    }
    if (seen >= 3 && 2 * explained < seen) tracks.push_back(track);
  }
  return tracks;
}

std::size_t CountObservations(const WhitenedTracks& whitened, const std::vector<int>& frames) {
  std::size_t count = 0;
  for (const int frame : frames) count += whitened.ObservationsIn(frame).size();
  return count;
}

// The model of the tracks that this one leaves unexplained, if they are many and it explains all
// tracks better; none: it does not. So of two bodies that move on their own (a thing turned before
// a wall) the one of most tracks is found, and no mixture of both.
std::optional<WorkingModel> MapOtherBody(const WorkingModel& model,
                                         const Camera& camera,
                                         const std::vector<int>& keyframes) {
  constexpr double kManyUnexplained = 0.15;  // share of the observations
  const WhitenedTracks& whitened = model.whitened();
  const WhitenedTracks unexplained = whitened.Select(UnexplainedTracks(model));
  if (static_cast<double>(CountObservations(unexplained, keyframes)) <
      kManyUnexplained * static_cast<double>(CountObservations(whitened, keyframes))) {
    return std::nullopt;
  }
  const PartResult body = MapBody(unexplained, camera, keyframes);
  if (!body.model) return std::nullopt;
  WorkingModel other(whitened, *body.model);
  other.TriangulateAllTracks();
  AdjustUntilSettled(other, 4, 5);
  const auto [cost, other_cost] = CompareCosts(model, other, keyframes);
  spdlog::debug("another body: {} tracks, {} frames; costs over all tracks {:.1f}, by it {:.1f}",
                unexplained.track_count(),
                other.registered(),
                cost,
                other_cost);
  if (!IsWorse(cost, other_cost, other.noise())) return std::nullopt;
  return other;
}

}  // namespace

PartResult MapPart(const WhitenedTracks& whitened,
                   const Camera& camera,
                   const std::vector<int>& keyframes) {
  PartResult part = MapBody(whitened, camera, keyframes);
  if (!part.model) return part;
  if (auto other = MapOtherBody(*part.model, camera, keyframes)) {
    part.model = std::move(other);
  }
  return part;
}

std::vector<WorkingModel> MapRemainingParts(PartResult first,
                                            const Camera& camera,
                                            std::vector<int> keyframes) {
  const WhitenedTracks& whitened = first.model->whitened();
  std::vector<WorkingModel> parts;
  PartResult part = std::move(first);
  while (part.model && parts.size() < kMaxParts) {
    RegisterOtherFrames(*part.model);
    std::vector<int> rest;
    for (const int k : keyframes) {
      if (!part.model->HasPose(k)) rest.push_back(k);
    }
    parts.push_back(std::move(*part.model));
    if (rest.size() < 2) break;
    keyframes = std::move(rest);
    part = MapPart(whitened, camera, keyframes);
  }
  std::stable_sort(parts.begin(), parts.end(), [](const WorkingModel& a, const WorkingModel& b) {
    return a.registered() > b.registered();
  });
  return parts;
}

}  // namespace cohort
