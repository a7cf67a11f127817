#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "pipelines/experiment/cells.h"

namespace cohort {

// The tracker options that a name of ExperimentOptions::trackers stands for; `base` says what the
// name does not. Throws UsageError.
TrackerOptions NamedTracker(const std::string& name, const TrackerOptions& base);

// The same with what is no option of a tracker: NAME-refined, NAME-online, ceiling, sift.
GridTracker NamedGridTracker(const std::string& name,
                             const TrackerOptions& base,
                             SecondPassMode second_pass);

// Does the tracker of `cohort track` have a second pass?
bool HasSecondPass(const GridTracker& tracker);

// klt21 is of the family klt, klt21-refined of klt-refined.
bool IsOfFamily(std::string_view tracker, std::string_view family);

// Is it kltN, without a second pass?
bool IsPlainKlt(const GridTracker& tracker);

// The options that a tracker's tracks depend on: without those of the other trackers.
nlohmann::ordered_json OwnOptions(const GridTracker& tracker);

}  // namespace cohort
