#pragma once

#include <optional>
#include <vector>

#include "backend/scene/growth.h"
#include "backend/scene/mapper_termination.h"
#include "backend/scene/reconstruction.h"

namespace cohort {

// A model of the keyframes, or of those of them that could be tied together; or why there is none.
struct PartResult {
  MapperEnd end;  // of one without a model
  std::optional<WorkingModel> model = std::nullopt;
  std::vector<Doubt> doubts = {};  // of the model
};

// Finds a start among these keyframes and grows it over them; with it a rival, a start of equal
// cost that is another scene. If all keyframes cannot tell the two apart, the one of the lower cost
// is returned, with this doubt.
PartResult MapPart(const WhitenedTracks& whitened,
                   const Camera& camera,
                   const GrowthOptions& growth,
                   const std::vector<int>& keyframes);

// A part of the clip, and what there was to doubt when it began (PartResult).
struct MappedPart {
  WorkingModel model;
  std::vector<Doubt> doubts;
};

// Models of the clip's parts: `first`, which has a model, with the frames between its keyframes and,
// where the tracks break off, models of what it left over. The one of most frames is first.
std::vector<MappedPart> MapRemainingParts(PartResult first,
                                          const Camera& camera,
                                          const GrowthOptions& growth,
                                          std::vector<int> keyframes);

}  // namespace cohort
