#pragma once

#include <optional>
#include <vector>

#include "backend/adjust/working_model.h"
#include "backend/scene/mapper_termination.h"

namespace cohort {

// A model of all keyframes, or of those that could be connected; otherwise why there is none.
struct PartResult {
  MapperEnd end;  // if there is no model
  std::optional<WorkingModel> model = std::nullopt;
};

// Finds a start among these keyframes and grows a model over them. If that leaves many tracks
// unexplained, and a model of those explains all tracks better, it is returned instead.
PartResult MapPart(const WhitenedTracks& whitened,
                   const Camera& camera,
                   const std::vector<int>& keyframes);

// Models of the clip's parts: `first`, which must have a model, with the frames between its
// keyframes, and models of the keyframes that it left out if the tracks break off. The part with
// the most frames is first.
std::vector<WorkingModel> MapRemainingParts(PartResult first,
                                            const Camera& camera,
                                            std::vector<int> keyframes);

}  // namespace cohort
