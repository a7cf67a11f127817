#pragma once

#include <filesystem>
#include <vector>

#include "datasets/readers/sequence.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/progress.h"

namespace cohort {

// A video of a clip's tracks, brightened so that a person sees them: one panel a file, side by side
// under its tracker's name and how many features it has; observed ones as dots, predicted ones as
// rings of another colour, their last positions as tails. Frames that a file lacks are left out.
// `path`: .mp4 (H.264), or .gif by the program ffmpeg. `width_px` of a panel; 0: the clip's. Whole
// or not at all. `sequence`: the clip, rewound here and read twice. Throws Error where it lacks a
// frame of the files, or they have none in common.
void WriteTrackVideo(const std::filesystem::path& path,
                     const std::vector<TrackFile>& files,
                     Sequence& sequence,
                     double frames_per_second,
                     int width_px,
                     const StageProgress& progress = {});

}  // namespace cohort
