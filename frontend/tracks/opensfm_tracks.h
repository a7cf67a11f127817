#pragma once

#include <cstddef>
#include <filesystem>

#include "frontend/tracks/imported_tracks.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// tracks.csv of OpenSfM, tab-separated; with D = max(width, height) of the image
//   x = (x_px + 0.5 - width / 2) / D,  y = (y_px + 0.5 - height / 2) / D
//   version 2: image, track_id, feature_id, x, y, scale, r, g, b, segmentation, instance
//   version 1: without the last two; version 0: without scale too, and without a first line
//   OPENSFM_TRACKS_VERSION_v1 that names the version.

// Writes the observed positions in version 2, scale = 1 px / D. Colours are black, segmentation and
// instance -1 (none). Whole or not at all. Returns how many tracks have a row.
std::size_t WriteOpenSfmTracks(const std::filesystem::path& path, const TrackFile& file);

// Reads all versions. Images are matched to frames by name; all frames have the same size. Rows of
// unknown images are skipped and counted. Throws Error naming path and line.
ImportedTracks ReadOpenSfmTracks(const std::filesystem::path& path,
                                 std::span<const FrameInfo> frames,
                                 int width_px,
                                 int height_px);

}  // namespace cohort
