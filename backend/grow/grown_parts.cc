#include "backend/grow/grown_parts.h"

#include <algorithm>
#include <utility>

#include "backend/grow/growth.h"
#include "backend/judge/judgement.h"
#include "backend/scene/spread_tracks.h"

namespace cohort {
namespace {

// Have all keyframes a pose in one part, which explains most of the parallax?
bool IsSure(const GrownParts& grown, const std::vector<int>& keyframes) {
  // Of a hand that turns the camera fast, where half the tracks made a model of twice the error,
  // they left 0.5 to 0.7; of other clips, 0.01 to 0.26.
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
  GrownParts grown = GrowParts(whitened, camera, keyframes);
  for (WorkingModel& part : grown.parts) AdjustUntilSettled(part, 3, 4);
  return grown;
}

}  // namespace

GrownParts GrowParts(const WhitenedTracks& whitened,
                     const Camera& camera,
                     const std::vector<int>& keyframes) {
  PartResult first = MapPart(whitened, camera, keyframes);
  GrownParts grown;
  grown.end = first.end;
  if (!first.model) return grown;
  grown.parts = MapRemainingParts(std::move(first), camera, keyframes);
  return grown;
}

std::optional<GrownParts> WithAllTracks(const WhitenedTracks& whitened,
                                        const GrownParts& by_some,
                                        const std::vector<int>& keyframes) {
  if (whitened.HasSeam() || !IsSure(by_some, keyframes)) return std::nullopt;
  WorkingModel model(whitened, by_some.parts.front());
  model.TriangulateAllTracks();
  RegisterOtherFrames(model);
  GrownParts all;
  all.parts.push_back(std::move(model));
  return all;
}

GrownParts GrowPartsBySome(const WhitenedTracks& whitened,
                           const Camera& camera,
                           const std::vector<int>& keyframes) {
  constexpr double kWorthIt = 0.75;
  if (whitened.HasSeam()) return GrowPartsByAll(whitened, camera, keyframes);
  const WhitenedTracks some = whitened.Select(SpreadTracks(whitened, camera, keyframes));
  if (static_cast<double>(some.observations().size()) <
      kWorthIt * static_cast<double>(whitened.observations().size())) {
    const GrownParts grown = GrowParts(some, camera, keyframes);
    if (auto all = WithAllTracks(whitened, grown, keyframes)) return std::move(*all);
  }
  return GrowPartsByAll(whitened, camera, keyframes);
}

}  // namespace cohort
