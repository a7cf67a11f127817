#pragma once

#include <optional>

#include "datasets/degrade/degrade.h"
#include "datasets/truth/track_truth.h"
#include "frontend/track/tracker_options.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// An upper bound, as tracks, for trackers that measure 21 x 21 px patches one by one: the corners
// that every tracker would be given in the degraded frames, with re-detection, at their true
// positions plus independent Gaussian noise at the Cramer-Rao bound of such a patch
// (datasets/truth/position_bound.h), with the bound as their covariance. Wider patches, and
// information from other features and frames, can exceed it. A feature is observed if it is truly
// visible and its bound is at most 3 px; hidden features are predicted at their true positions, and
// end as every tracker's. The first position of a track has no noise: it defines what it follows.
// `clip` gives the frames that `degrade` was applied to, `dark` its result, with the masks; `truth`
// is of `dark`. Both run over the same frames. Fills frames and tracks of the result.
TrackFile MakeCeilingTracks(Sequence& clip,
                            Sequence& dark,
                            TrackTruth& truth,
                            const DegradeOptions& degrade,
                            const TrackerOptions& tracking);

}  // namespace cohort
