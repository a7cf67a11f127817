#pragma once

#include <filesystem>

#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/progress.h"

namespace cohort {

// Tracks of a video name pictures that do not exist. This decodes the video again and writes the
// named frames into `folder` (created or replaced whole), so that COLMAP finds them. Throws Error
// if the video has moved or is another.
void WriteVideoFrames(const TrackFile& file,
                      const std::filesystem::path& folder,
                      const StageProgress& progress = {});

}  // namespace cohort
