#pragma once

#include <filesystem>
#include <vector>

#include "datasets/readers/sequence.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/progress.h"

namespace cohort {

// A video of a clip's tracks, brightened for viewing: one panel per file, side by side, with its
// tracker's name and number of features. Observed features are dots, predicted ones are rings of
// another colour, and their last positions are tails. Frames that a file lacks are skipped. `path`:
// .mp4 (H.264), or .gif by the program ffmpeg. `width_px` is that of a panel; 0: the clip's. Whole
// or not at all. `sequence`: the clip, rewound here and read twice. Throws Error if it lacks a
// frame of the files, or they have none in common.
void WriteTrackVideo(const std::filesystem::path& path,
                     const std::vector<TrackFile>& files,
                     Sequence& sequence,
                     double frames_per_second,
                     int width_px,
                     const StageProgress& progress = {});

}  // namespace cohort
