#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "pipelines/experiment/results.h"

namespace cohort {

// The clip, level and seed whose tracks and models the report shows, by tracker: the first clip
// (with truth, if any has), the darkest level, the first seed. Not chosen by what came out.
std::vector<const TrackCell*> ShowcaseCells(const ExperimentResults& results);

// The tracks of these cells, which are of one clip, over its darkest frame, for the page: of each
// tracker a picture and how many tracks it has.
nlohmann::ordered_json TrackPicturesToJson(const std::vector<const TrackCell*>& cells);

}  // namespace cohort
