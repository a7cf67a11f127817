#pragma once

#include <filesystem>
#include <optional>

#include "datasets/readers/video_decoder.h"

namespace cohort {

// How a video is interlaced: each frame holds two pictures, one in its even and one in its odd rows.
struct Interlacing {
  FieldOrder order;
  bool flagged;  // the file says so
};

// nullopt for a progressive video. The file's flags decide, unless its first frames (up to 60, until
// ten of them have moved enough) clearly show something else: combed frames that are not flagged, or
// flagged frames that are not combed, as of cameras that store 25 progressive frames a second as
// interlaced ones. Throws as VideoDecoder.
std::optional<Interlacing> InterlacingOf(const std::filesystem::path& file);

}  // namespace cohort
