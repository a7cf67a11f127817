#pragma once

#include "frontend/tracks/track_set.h"

namespace cohort {

// Tracks of two trackers of one clip; the features from `first_companion` on are of the second.
struct CompanionTracks {
  TrackSet tracks;
  FeatureId first_companion{};
};

// Without the companion's twins: tracks of which most observations lie within `within_px` of the
// same feature of the first tracker.
TrackSet DropTwins(const CompanionTracks& both, double within_px);

// Without those of the companion's tracks that are not needed: kept are tracks that bridge two
// consecutive frames of which the first tracker ties less than `share` as many features to each
// other as the companion does, or than it does itself in the median.
CompanionTracks KeepWhereNeeded(const CompanionTracks& both, double share);

// Makes one set of two: twins are dropped, and what is left of the companion's is numbered behind
// the last feature of the first tracker. Its observations have no covariance of their own; they get
// one for all, the robust variance of the twins' positions about those of the first tracker (each
// pair's median apart, as two features may be of two pixels of one corner) [px^2]. Without enough
// twins none is known, and none is given.
CompanionTracks JoinCompanions(const CompanionTracks& both, double within_px);

}  // namespace cohort
