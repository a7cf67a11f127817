#pragma once

#include <Eigen/Core>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "frontend/geometry/rigid3.h"
#include "frontend/tracks/observation.h"
#include "pipelines/experiment/results.h"
#include "pipelines/report/headline.h"

namespace cohort {

// The mean of the cameras' centres; 0 without any. Pages store all positions relative to it: the
// numbers stay short even if the world is far from its origin, as on a map.
Eigen::Vector3d MiddleOfCameras(const std::map<FrameIndex, Rigid3>& cam_from_world);

// For the page's 3-D view: of these cells, which belong to one clip, the reconstructions of the
// best KLT and the cohort, or without a headline of the first two trackers. Gives the camera path
// and points of each, in the frame of the ground truth or, without it, of the first, about the
// middle of its cameras, and their `up`.
nlohmann::ordered_json ModelsToJson(const ExperimentResults& results,
                                    const std::vector<const TrackCell*>& cells,
                                    const std::optional<Headline>& headline);

}  // namespace cohort
