#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "frontend/tracks/track_set.h"

namespace cohort {

// Tracks as comma-separated text, one row per observation; the header names the columns:
//   track_id,frame,x,y,observed,residual
// track_id and frame are integers from 0; x, y in pixels, the centre of the top-left pixel is
// (0, 0); observed is 1, or 0 where the position is predicted; residual in intensities 0..1.

struct TracksCsv {
  TrackSet tracks;
  // Empty: FeatureId{n} is track_id n. Otherwise an id of the file needs more than 32 bits, and
  // FeatureId{n} stands for track_ids[n], ascending.
  std::vector<std::uint64_t> track_ids;
};

// Columns are found by their names, in any order; observed (default 1) and residual (default 0) may
// be missing, and other columns are skipped. Without observed, a column visible or visibility
// replaces it, or the negation of occluded; numbers from 0.5 on are true. Throws Error naming path
// and line on invalid input.
TracksCsv ReadTracksCsv(const std::filesystem::path& path);

// Sorted by (track_id, frame), numbers with the fewest digits that read back the same. Whole or not
// at all.
void WriteTracksCsv(const std::filesystem::path& path, const TrackSet& tracks);

}  // namespace cohort
