#pragma once

#include <optional>
#include <vector>

#include "backend/scene/adjustment.h"
#include "backend/scene/grown_parts.h"

namespace cohort {

// What the tracks say of a camera that nobody knows.
struct FoundCamera {
  Camera camera;                // at its minimum; still a guess
  std::optional<Camera> rival;  // a different one that explains the tracks as well
  // The clip's parts as the search left them (WithAllTracks); none: they are to be grown anew.
  std::optional<GrownParts> grown;
};

// The camera by a list of hypotheses, each of which is a lens and a focal length: a model is grown with
// it of some of the tracks, and adjusted with all that is refined until nothing moves (AdjustCamera).
// The hypothesis that leaves least unexplained is taken. As soon as two of them end at one camera, or the
// first at the one that was `found_before`, no further ones are tried. None: no hypothesis gives a model.
std::optional<FoundCamera> SearchCamera(const WhitenedTracks& whitened,
                                        const Camera& guess,
                                        const std::optional<Camera>& found_before,
                                        const CameraRefinement& refinement,
                                        const std::vector<int>& keyframes);

}  // namespace cohort
