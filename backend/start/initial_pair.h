#pragma once

#include <string>
#include <vector>

#include "backend/start/two_view_geometry.h"

namespace cohort {

struct InitialPair {
  FrameIndex frame1{};
  FrameIndex frame2{};
  std::size_t common = 0;    // matches the geometry was estimated from
  TwoViewGeometry geometry;  // of MatchFrames(tracks, frame1, frame2)
  double score = 0.0;
};

// Why pairs were rejected; the largest count characterises the clip.
struct InitialPairRefusals {
  int too_few_common = 0;
  int standstill = 0;  // nothing moves
  int rotation = 0;    // turning on the spot
  int low_angle = 0;
  int degenerate = 0;
};

struct InitialPairSearch {
  std::vector<InitialPair> ranked;  // best first; empty: none was found
  InitialPairRefusals refusals;
  std::string reason;  // one line: which pair and its figures, or why there is none
};

// "initial pair: frames 3 and 9, calibrated, 80 of 85 matches, angle 6.0 deg, ..."
std::string DescribeInitialPair(const InitialPair& pair);

// Tries pairs that start on a coarse grid over the clip and still share 80, 60 and 40 % of the
// first frame's features, and ranks them by
//   inliers * min(1, angle / good_angle) * (1 - homography_ratio^4 / 2) * max(0.2, sideways)
//           * evidence,
// where sideways is the part of the (unit) translation across the optical axis and evidence grows
// from 0 to 1 as the parallax grows from that of pure noise to six times as much. good_angle is 12
// degrees, half of it for a plane. The grid has at most 22 starts (of 23 frames), usually 12, of
// three pairs each.
InitialPairSearch FindInitialPairs(const TrackSet& tracks, const Camera& camera);

}  // namespace cohort
