#pragma once

#include <optional>
#include <vector>

#include "backend/grow/growth.h"
#include "backend/scene/mapper_termination.h"
#include "backend/scene/reconstruction.h"

namespace cohort {

// A model of all keyframes, or of those that could be connected; otherwise why there is none.
struct PartResult {
  MapperEnd end;  // if there is no model
  std::optional<WorkingModel> model = std::nullopt;
  std::vector<Doubt> doubts = {};  // of the model
};

// Finds a start among these keyframes and grows a model over them. A rival, a start of equal cost
// that shows another scene, is grown too. If the keyframes do not distinguish the two, the model of
// the lower cost is returned, with this doubt.
PartResult MapPart(const WhitenedTracks& whitened,
                   const Camera& camera,
                   const GrowthOptions& growth,
                   const std::vector<int>& keyframes);

// A part of the clip, and the doubts from its start (PartResult).
struct MappedPart {
  WorkingModel model;
  std::vector<Doubt> doubts;
};

// Models of the clip's parts: `first`, which must have a model, with the frames between its
// keyframes, and models of the keyframes that it left out if the tracks break off. The part with
// most frames is first.
std::vector<MappedPart> MapRemainingParts(PartResult first,
                                          const Camera& camera,
                                          const GrowthOptions& growth,
                                          std::vector<int> keyframes);

}  // namespace cohort
