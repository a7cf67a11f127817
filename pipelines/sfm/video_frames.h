#pragma once

#include <filesystem>

#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/progress.h"

namespace cohort {

// Tracks of a video name pictures that do not exist: decodes the video again and writes the named
// frames into `folder` (made or replaced whole), so that COLMAP finds them. Throws Error where the
// video has moved or is another.
void WriteVideoFrames(const TrackFile& file,
                      const std::filesystem::path& folder,
                      const StageProgress& progress = {});

}  // namespace cohort
