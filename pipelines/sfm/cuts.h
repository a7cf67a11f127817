#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "frontend/tracks/track_store.h"

namespace cohort {

// The cuts of a clip: the first frames of another scene, ascending. A file keeps them in
// meta["cuts"], separated by blanks; a clip without cuts has no such entry.
inline constexpr const char* kCutsMeta = "cuts";
void NoteCuts(const std::vector<FrameIndex>& cuts, std::map<std::string, std::string>& meta);
std::vector<FrameIndex> CutsOf(const TrackFile& file);
std::vector<std::uint32_t> NumbersOf(const std::vector<FrameIndex>& frames);  // for JSON

// "frame 12", "frames 12 and 57"; of many the first few and the number of the rest.
std::string CutsText(const std::vector<FrameIndex>& cuts);

}  // namespace cohort
