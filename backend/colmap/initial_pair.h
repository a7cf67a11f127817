#pragma once

#include <optional>
#include <string>
#include <vector>

#include "backend/scene/mapper_termination.h"
#include "backend/start/two_view_geometry.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// Two frames from which COLMAP's mapper starts.
struct InitialPair {
  FrameIndex frame1{};
  FrameIndex frame2{};
  TwoViewGeometry geometry;
};

struct InitialPairs {
  std::vector<InitialPair> ranked;  // best first; none begin in the same frame
  std::optional<MapperEnd> end;     // set if no pair can give a model: why
};

// "initial pair: frames 3 and 9, 80 common tracks, angle 6.0 deg"
std::string DescribeInitialPair(const InitialPair& pair);

// The best `most` of the mapper's own ranking (RankPairs) that have a relative pose. `camera`: that
// of all frames.
InitialPairs FindInitialPairs(const TrackFile& file, const Camera& camera, int most);

}  // namespace cohort
