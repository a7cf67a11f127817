#pragma once

#include <cstddef>
#include <vector>

#include "frontend/tracks/track_set.h"

namespace cohort {

// Ids from here on are of a companion: a second tracker of the same clip.
inline constexpr FeatureId kFirstCompanion{1U << 30U};

// Frames first to last, both included.
struct Stretch {
  FrameIndex first{};
  FrameIndex last{};
};
// Where a tracker loses its features: pairs of consecutive frames that fewer than `share` of the
// features of the first, or of the number usual between frames (the median; until that is reached,
// the most so far), tie to each other; and `reach` frames before and behind, in which a companion
// may take up features. Ascending, apart.
std::vector<Stretch> WeakStretches(const TrackSet& tracks, double share, std::size_t reach);

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
