#pragma once

#include <filesystem>

#include "frontend/tracks/track_store.h"

namespace cohort::test {

// Real tracks of the shared data folder (shared_data.h), which hold no pictures.

// One track a line, x and y of every frame in turn; -1 -1 where it is not seen.
TrackFile ReadTrackLines(const std::filesystem::path& path, const Camera& camera);

// Xs.txt and Ys.txt: one frame a line, one track a column; counted from (1, 1).
TrackFile ReadTrackTables(const std::filesystem::path& folder, const Camera& camera);

}  // namespace cohort::test
