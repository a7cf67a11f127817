#pragma once

#include <nlohmann/json_fwd.hpp>

#include "pipelines/experiment/plan.h"

namespace cohort {

// The work of a cell's tasks. Each returns the figures of its result (tasks.h), which cell_rows.h
// reads, and leaves its files in the cell's folder. Figures {"not_available": why} mark an
// impossible cell. Throw if a cell fails.

// The cell's tracks, and their errors if the ground truth is known.
nlohmann::ordered_json MakeTracks(const ExperimentOptions& options, const TrackCell& cell);
// A model of them, and its errors.
nlohmann::ordered_json ReconstructCell(const ExperimentOptions& options,
                                       const TrackCell& cell,
                                       GridBackend backend);
// The agreement of the models of both halves of the tracks. Each half gets its own second pass,
// because a shared one would make them agree.
nlohmann::ordered_json CompareHalvesOfCell(const ExperimentOptions& options,
                                           const TrackCell& cell,
                                           GridBackend backend);
// Protocol paper: both of its modes.
nlohmann::ordered_json FollowCell(const ExperimentOptions& options, const TrackCell& cell);

// SIFT's options with the mask of all trackers.
SiftOptions SiftOptionsOf(const ExperimentOptions& options);
// COLMAP's options with the cell's seed.
ColmapOptions ColmapOptionsOf(const ExperimentOptions& options, const TrackCell& cell);

}  // namespace cohort
