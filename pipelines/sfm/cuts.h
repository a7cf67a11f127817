#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "frontend/tracks/track_store.h"

namespace cohort {

// Forms of the cuts of a clip (TrackMeta::cuts).
std::vector<std::uint32_t> NumbersOf(const std::vector<FrameIndex>& frames);  // for JSON

// "frame 12", "frames 12 and 57"; of many the first few and the number of the rest.
std::string CutsText(const std::vector<FrameIndex>& cuts);

// "--frames 12:57:2": the option that reads, of the frames that the tracks were made from, those
// from `first` on up to but without `end` (none: to the last).
std::string FramesOption(const TrackFile& file,
                         FrameIndex first,
                         std::optional<FrameIndex> end = std::nullopt);

}  // namespace cohort
