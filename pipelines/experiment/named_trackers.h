#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "pipelines/experiment/cells.h"

namespace cohort {

// The tracker options for a name of ExperimentOptions::trackers; `base` gives the rest. Throws
// UsageError.
TrackerOptions NamedTracker(const std::string& name, const TrackerOptions& base);

// The same, including names that tracker options cannot express: NAME-refined, NAME-online,
// ceiling, sift.
GridTracker NamedGridTracker(const std::string& name,
                             const TrackerOptions& base,
                             SecondPassMode second_pass);

// Whether the tracker of `cohort track` has a second pass.
bool HasSecondPass(const GridTracker& tracker);

// klt21 belongs to the family klt, klt21-refined to klt-refined.
bool IsOfFamily(std::string_view tracker, std::string_view family);

// Whether it is kltN, without a second pass.
bool IsPlainKlt(const GridTracker& tracker);

// The options that affect a tracker's tracks, without those of the other trackers.
nlohmann::ordered_json OwnOptions(const GridTracker& tracker);

}  // namespace cohort
