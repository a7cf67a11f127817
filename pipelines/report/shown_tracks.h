#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "pipelines/experiment/results.h"

namespace cohort {

// The clip, level and seed whose tracks and models the report shows, by tracker: the first clip
// (with ground truth, if any has it), the darkest level, the first seed. Results do not affect the
// choice.
std::vector<const TrackCell*> ShowcaseCells(const ExperimentResults& results);

// The tracks of these cells, which belong to one clip, over its darkest frame, for the page: a
// picture and the number of tracks of each tracker.
nlohmann::ordered_json TrackPicturesToJson(const std::vector<const TrackCell*>& cells);

}  // namespace cohort
