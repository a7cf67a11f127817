#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "frontend/tracks/track_store.h"

namespace cohort {

// Forms of the cuts of a clip (TrackMeta::cuts).
std::vector<std::uint32_t> NumbersOf(const std::vector<FrameIndex>& frames);  // for JSON

// "frame 12", "frames 12 and 57"; of many the first few and the number of the rest.
std::string CutsText(const std::vector<FrameIndex>& cuts);

}  // namespace cohort
