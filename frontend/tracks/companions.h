#pragma once

#include <cstddef>
#include <vector>

#include "frontend/tracks/track_set.h"

namespace cohort {

// Ids from here on belong to a companion: a second tracker of the same clip.
inline constexpr FeatureId kFirstCompanion{1U << 30U};

// Frames first to last, both included.
struct Stretch {
  FrameIndex first{};
  FrameIndex last{};
};
// Where a tracker loses its features: pairs of consecutive frames linked by fewer than `share` of
// the first frame's features, or of the usual number of links (the median, or the most so far until
// that is reached). Each stretch extends by `reach` frames on both sides, in which a companion may
// take up features. Ascending, disjoint.
std::vector<Stretch> WeakStretches(const TrackSet& tracks, double share, std::size_t reach);

// Tracks of two trackers of one clip; features from `first_companion` on are the second's.
struct CompanionTracks {
  TrackSet tracks;
  FeatureId first_companion{};
};

// Removes the companion's twins: tracks of which most observations lie within `within_px` of the
// same feature of the first tracker.
TrackSet DropTwins(const CompanionTracks& both, double within_px);

// Removes the companion's tracks that are not needed. A track is kept if it links two consecutive
// frames between which the first tracker has less than `share` times the companion's links, or
// times its own median.
CompanionTracks KeepWhereNeeded(const CompanionTracks& both, double share);

// Merges both sets. Twins are removed, and the companion's remaining features are numbered after
// the last feature of the first tracker. They share one covariance: the robust variance of the
// twins' positions about those of the first tracker [px^2]. Each pair's median is subtracted first,
// because two features may be at two pixels of one corner. Without enough twins they have no
// covariance.
CompanionTracks JoinCompanions(const CompanionTracks& both, double within_px);

}  // namespace cohort
