#include "backend/grow/grown_parts.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "backend/grow/growth.h"
#include "backend/judge/judgement.h"
#include "backend/scene/spread_tracks.h"

namespace cohort {
namespace {

GrownParts GrowParts(const WhitenedTracks& whitened,
                     const Camera& camera,
                     const GrowthOptions& growth,
                     const std::vector<int>& keyframes) {
  PartResult first = MapPart(whitened, camera, growth, keyframes);
  GrownParts grown;
  grown.end = first.end;
  if (!first.model) return grown;
  grown.parts = MapRemainingParts(std::move(first), camera, growth, keyframes);
  return grown;
}

// Have all keyframes a pose in one part, which explains most of the parallax?
bool IsSure(const GrownParts& grown, const std::vector<int>& keyframes) {
  // Of a hand that turns the camera fast, where half the tracks made a model of twice the error, they
  // left 0.5 to 0.7; of other clips, 0.01 to 0.26.
  constexpr double kMostUnexplained = 0.4;
  if (grown.parts.size() != 1) return false;
  const WorkingModel& model = grown.parts.front();
  return std::all_of(
             keyframes.begin(), keyframes.end(), [&](int frame) { return model.HasPose(frame); }) &&
         UnexplainedParallax(model, keyframes) <= kMostUnexplained;
}

// By all tracks, settled.
GrownParts GrowPartsByAll(const WhitenedTracks& whitened,
                          const Camera& camera,
                          const std::vector<int>& keyframes) {
  GrownParts grown = GrowPartsBothWays(whitened, camera, keyframes);
  for (WorkingModel& part : grown.parts) AdjustUntilSettled(part, 3, 4);
  return grown;
}

}  // namespace

GrownParts GrowPartsBothWays(const WhitenedTracks& whitened,
                             const Camera& camera,
                             const std::vector<int>& keyframes) {
  // Of the inliers. Where far points had less, both ways gave about the same model on real clips, but
  // of a hand that turns the camera, where near ones alone were worse; where those lost the scale of
  // a drive, far points had a quarter.
  constexpr double kManyFarPoints = 0.05;
  GrownParts far = GrowParts(whitened, camera, {kFarRayAngleDeg}, keyframes);
  if (!far.parts.empty() && far.parts.front().ShareOfFarPoints() < kManyFarPoints) return far;
  GrownParts near = GrowParts(whitened, camera, {kNearRayAngleDeg}, keyframes);
  if (near.parts.empty()) return far;
  if (far.parts.empty()) return near;
  for (GrownParts* grown : {&far, &near}) AdjustUntilSettled(grown->parts.front(), 3, 4);
  const WorkingModel& by_far = far.parts.front();
  const WorkingModel& by_near = near.parts.front();
  std::vector<int> frames(whitened.frame_count());
  std::iota(frames.begin(), frames.end(), 0);
  const ComparedCosts costs = CompareCosts(by_near, by_far, frames);
  spdlog::debug("grown by near points {} frames, cost {:.1f}; by far ones {}, {:.1f}",
                by_near.registered(),
                costs.a,
                by_far.registered(),
                costs.b);
  return costs.a <= costs.b ? std::move(near) : std::move(far);
}

std::optional<GrownParts> WithAllTracks(const WhitenedTracks& whitened,
                                        const GrownParts& by_some,
                                        const std::vector<int>& keyframes) {
  if (whitened.HasSeam() || !IsSure(by_some, keyframes)) return std::nullopt;
  WorkingModel model(whitened, by_some.parts.front());
  model.SetMinRayAngle(kFarRayAngleDeg);
  model.TriangulateAllTracks();
  RegisterOtherFrames(model);
  GrownParts all;
  all.parts.push_back(std::move(model));
  return all;
}

GrownParts GrowPartsBySome(const WhitenedTracks& whitened,
                           const Camera& camera,
                           const std::vector<int>& keyframes) {
  constexpr int kPerCell = 2;
  constexpr double kWorthIt = 0.75;
  if (whitened.HasSeam()) return GrowPartsByAll(whitened, camera, keyframes);
  const WhitenedTracks some = whitened.Select(SpreadTracks(whitened, camera, keyframes, kPerCell));
  if (static_cast<double>(some.observations().size()) <
      kWorthIt * static_cast<double>(whitened.observations().size())) {
    const GrownParts grown = GrowPartsBothWays(some, camera, keyframes);
    if (auto all = WithAllTracks(whitened, grown, keyframes)) return std::move(*all);
  }
  return GrowPartsByAll(whitened, camera, keyframes);
}

}  // namespace cohort
