#pragma once

#include <filesystem>
#include <optional>

#include "datasets/readers/video_decoder.h"

namespace cohort {

// How a video is interlaced: a frame holds two pictures, one in its even and one in its odd rows.
struct Interlacing {
  FieldOrder order;
  bool flagged;  // the file says so
};

// nullopt for a progressive video. The file's flags decide, unless its first frames (60 at most,
// until ten of them show it) clearly show something else: combs that are not flagged, another order
// of the fields, or no combs where they are flagged, as of cameras that store 25 progressive frames
// a second as interlaced ones. Throws as VideoDecoder.
std::optional<Interlacing> InterlacingOf(const std::filesystem::path& file);

}  // namespace cohort
