#pragma once

#include <memory>
#include <set>
#include <string>

#include "frontend/track/loop/feature_mover.h"
#include "frontend/track/loop/track_loop.h"
#include "frontend/track/tracker_options.h"

namespace cohort {

// Tracks features from frame to frame:
//
//   auto tracker = MakeTracker(options);
//   while (auto frame = sequence->Next()) Use(tracker->Track(*frame));
//
// Throws UsageError if an option is out of range.
std::unique_ptr<TrackLoop> MakeTracker(const TrackerOptions& options);

// Its mover, for callers that do the bookkeeping themselves.
std::unique_ptr<FeatureMover> MakeMover(const TrackerOptions& options);

// What the tracker reads of the groups of options, beside the detector's: names of groups, and
// `group.option` where it is not the whole group.
std::set<std::string> OptionsReadBy(const TrackerOptions& options);

}  // namespace cohort
