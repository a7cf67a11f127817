#pragma once

#include <nlohmann/json_fwd.hpp>

#include "pipelines/experiment/plan.h"

namespace cohort {

// What the tasks of a cell do: each returns the figures of its result (tasks.h), which cell_rows.h
// reads, and leaves its files in the cell's folder. Figures {"not_available": why} say that a cell
// cannot be. Throw where a cell fails.

// The cell's tracks, and their errors where the truth is known.
nlohmann::ordered_json MakeTracks(const ExperimentOptions& options, const TrackCell& cell);
// A model of them, and its errors.
nlohmann::ordered_json ReconstructCell(const ExperimentOptions& options,
                                       const TrackCell& cell,
                                       GridBackend backend);
// How far the models of both halves of them agree; halves that had a second pass together would
// agree by it, so each gets one of its own.
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
