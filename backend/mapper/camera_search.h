#pragma once

#include <optional>
#include <vector>

#include "backend/adjust/adjustment.h"
#include "backend/grow/grown_parts.h"

namespace cohort {

// The camera that the tracks imply if it is unknown.
struct FoundCamera {
  Camera camera;                // at the minimum; still a guess
  std::optional<Camera> rival;  // a different one that explains the tracks as well
  // The clip's parts as the search left them (WithAllTracks); nullopt if they must be grown again.
  std::optional<GrownParts> grown;
};

// Searches for the camera from several focal lengths: `found_before`, the guess, and some others.
// From each it grows a model of some tracks and refines it until it no longer changes
// (AdjustCamera). The model of lowest cost wins; a wide pinhole is then also tried as a fisheye.
// The search stops early when two models converge to one camera, or one to `found_before`. Returns
// nullopt if no focal length gives a model.
std::optional<FoundCamera> SearchCamera(const WhitenedTracks& whitened,
                                        const Camera& guess,
                                        const std::optional<Camera>& found_before,
                                        const CameraRefinement& refinement,
                                        const std::vector<int>& keyframes);

}  // namespace cohort
