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

// The mean of the cameras' centres; 0 without any. Pages have all positions from it: their numbers
// are short, and a world may be far from its origin, as on a map.
Eigen::Vector3d MiddleOfCameras(const std::map<FrameIndex, Rigid3>& cam_from_world);

// For the page's 3-D view: of these cells, which are of one clip, the best KLT's reconstruction and
// the cohort's, without a headline the first two trackers'; camera path and points of each, in the
// frame of the truth or, without, of the first, about the middle of its cameras; `up`: theirs.
nlohmann::ordered_json ModelsToJson(const ExperimentResults& results,
                                    const std::vector<const TrackCell*>& cells,
                                    const std::optional<Headline>& headline);

}  // namespace cohort
